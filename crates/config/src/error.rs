//! Why a text is no configuration.

use std::fmt;

/// Why a text is no configuration: the key, what came, and what may come.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error(pub(crate) String);

impl fmt::Display for Error {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(&self.0)
    }
}

impl std::error::Error for Error {}

impl From<toml::de::Error> for Error {
    fn from(error: toml::de::Error) -> Self {
        Self::of_value(&error, "")
    }
}

impl Error {
    /// The error of a value below `path`, whose key its text has in the last line.
    pub(crate) fn of_value(error: &toml::de::Error, path: &str) -> Self {
        let text = error.to_string();
        let text = text.trim_end();
        Self(match text.rsplit_once("\nin `") {
            Some((what, key)) => format!("{path}{}: {what}", key.trim_end_matches('`')),
            None => format!("configuration: {text}"),
        })
    }
}
