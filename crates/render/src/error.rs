use core::fmt;

/// A value from which no renderer can be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Error {
    /// Path of the value in the configuration, such as `camera.fx`.
    pub field: &'static str,
    /// What came.
    pub value: f64,
    /// What may come, in words.
    pub allowed: &'static str,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            field,
            value,
            allowed,
        } = self;
        write!(f, "{field}: got {value}, expected {allowed}")
    }
}

impl core::error::Error for Error {}

/// `value` when it is finite and `test` holds.
pub(crate) fn checked(
    field: &'static str,
    value: f64,
    allowed: &'static str,
    test: impl Fn(f64) -> bool,
) -> Result<f64, Error> {
    if value.is_finite() && test(value) {
        Ok(value)
    } else {
        Err(Error {
            field,
            value,
            allowed,
        })
    }
}

/// `value` when it is finite.
pub(crate) fn finite(field: &'static str, value: f64) -> Result<f64, Error> {
    checked(field, value, "a finite number", |_| true)
}

/// `value` when it is finite and above zero.
pub(crate) fn positive(field: &'static str, value: f64) -> Result<f64, Error> {
    checked(field, value, "a number above 0", |v| v > 0.0)
}
