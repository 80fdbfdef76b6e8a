//! Errors of the core as exceptions of `tautscope.errors`.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use tautscope_core::ConfigError;

/// A `ConfigError` as `tautscope.errors.ConfigError`.
pub fn config(py: Python<'_>) -> impl Fn(ConfigError) -> PyErr {
    move |error| exception(py, "ConfigError", error.field, error.value, error.allowed)
}

/// A `tautscope.errors.ConfigError` for a name that is not allowed.
pub fn choice(py: Python<'_>, field: &str, name: &str, allowed: &str) -> PyErr {
    exception(py, "ConfigError", field, name, allowed)
}

/// A `tautscope.errors.SignalError` for an array of the wrong length.
pub fn length(py: Python<'_>, field: &str, length: usize, allowed: &str) -> PyErr {
    let value = format!("{length} values");
    exception(py, "SignalError", field, value, allowed)
}

/// An exception of the class `class` of `tautscope.errors`.
pub fn exception<'py>(
    py: Python<'py>,
    class: &str,
    field: &str,
    value: impl IntoPyObjectExt<'py>,
    allowed: &str,
) -> PyErr {
    let value = match value.into_bound_py_any(py) {
        Ok(value) => value,
        Err(error) => return error,
    };
    py.import("tautscope.errors")
        .and_then(|errors| errors.getattr(class))
        .and_then(|class| class.call1((field, value, allowed)))
        .map_or_else(|error| error, PyErr::from_value)
}
