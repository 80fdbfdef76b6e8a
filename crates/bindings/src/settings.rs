//! Conversion of a Python mapping to the settings struct with its keys as fields.

use pyo3::prelude::*;
use serde::de::DeserializeOwned;

use crate::errors;

/// A settings struct from a nested mapping; unknown keys are ignored.
///
/// # Errors
/// `ConfigError` on `table`: a key is missing, or a value is not of the type of its field.
pub fn from_mapping<T: DeserializeOwned>(table: &str, mapping: Bound<'_, PyAny>) -> PyResult<T> {
    let py = mapping.py();
    serde_pyobject::from_pyobject(mapping).map_err(|error| {
        let found = PyErr::from(error).value(py).to_string();
        errors::choice(py, table, &found, "the settings of its configuration class")
    })
}
