//! The error of a constructor whose argument is out of range.

use core::fmt;

/// A configuration value that is out of range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConfigError {
    /// The name of the argument.
    pub field: &'static str,
    /// The value given.
    pub value: f64,
    /// The allowed values, in words.
    pub allowed: &'static str,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            field,
            value,
            allowed,
        } = self;
        write!(formatter, "{field}: got {value}, expected {allowed}")
    }
}

impl core::error::Error for ConfigError {}

pub(crate) fn require(
    holds: bool,
    field: &'static str,
    value: f64,
    allowed: &'static str,
) -> Result<(), ConfigError> {
    if holds {
        Ok(())
    } else {
        Err(ConfigError {
            field,
            value,
            allowed,
        })
    }
}

pub(crate) fn require_finite(field: &'static str, value: f64) -> Result<(), ConfigError> {
    require(value.is_finite(), field, value, "a finite number")
}

pub(crate) fn require_positive(field: &'static str, value: f64) -> Result<(), ConfigError> {
    let holds = value.is_finite() && value > 0.0;
    require(holds, field, value, "a finite number above 0")
}

/// [`require_positive`] of every value of some fields.
pub(crate) fn require_all_positive(fields: &[(&'static str, &[f64])]) -> Result<(), ConfigError> {
    let values = fields
        .iter()
        .flat_map(|(field, values)| values.iter().map(move |value| (field, value)));
    values
        .into_iter()
        .try_for_each(|(field, value)| require_positive(field, *value))
}

pub(crate) fn require_non_negative(field: &'static str, value: f64) -> Result<(), ConfigError> {
    let holds = value.is_finite() && value >= 0.0;
    require(holds, field, value, "a finite number, 0 or above")
}

pub(crate) fn require_fraction(field: &'static str, value: f64) -> Result<(), ConfigError> {
    let holds = value > 0.0 && value < 1.0;
    require(holds, field, value, "a number above 0 and below 1")
}
