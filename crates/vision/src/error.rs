//! The error that constructors return.

use std::fmt;

/// An input has a value that is not allowed.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// Name of the input.
    pub field: &'static str,
    /// The value that was given.
    pub value: String,
    /// The allowed values, in words.
    pub allowed: &'static str,
}

impl Error {
    pub(crate) fn new(field: &'static str, value: &impl fmt::Debug, allowed: &'static str) -> Self {
        Self {
            field,
            value: format!("{value:?}"),
            allowed,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (field, value) = (self.field, &self.value);
        write!(formatter, "{field}: got {value}, expected {}", self.allowed)
    }
}

impl std::error::Error for Error {}
