//! What a constructor refuses.

use std::fmt;

/// A named input holds what it may not.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// Which input.
    pub field: &'static str,
    /// What came.
    pub value: String,
    /// What may come, in words.
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
        let Self {
            field,
            value,
            allowed,
        } = self;
        write!(formatter, "{field}: got {value}, expected {allowed}")
    }
}

impl std::error::Error for Error {}
