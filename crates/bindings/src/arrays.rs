//! Conversion between numpy arrays and the fixed-size arrays of the core.

use numpy::ndarray::ArrayView1;
use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayLike1, PyArrayLike2, PyArrayMethods};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::errors;

/// Anything that numpy converts to a vector (n,).
pub type Vector<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;

/// Anything that numpy converts to a table (n, columns).
pub type Table<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;

/// An argument before it is converted, so that the error can name it.
pub type Given<'py> = Bound<'py, PyAny>;

/// The array of an argument.
pub fn array<'a, 'py, T>(field: &str, given: &'a Given<'py>, allowed: &str) -> PyResult<T>
where
    T: FromPyObject<'a, 'py, Error = PyErr>,
{
    given.extract().map_err(|error: PyErr| {
        let py = given.py();
        let is_other = error.is_instance_of::<PyTypeError>(py)
            || error.is_instance_of::<PyValueError>(py)
            || error.is_instance_of::<PyOverflowError>(py);
        if is_other {
            errors::exception(py, "SignalError", field, given, allowed)
        } else {
            error
        }
    })
}

/// The number of an argument.
pub fn number(field: &str, given: &Given<'_>) -> PyResult<f64> {
    array(field, given, "a number")
}

/// The N values of a vector.
pub fn fixed<const N: usize>(field: &str, given: &Given<'_>) -> PyResult<[f64; N]> {
    let array: Vector<'_> = array(field, given, &format!("an array ({N},) of numbers"))?;
    let view = array.as_array();
    row(view).ok_or_else(|| {
        let allowed = format!("{N} values");
        errors::length(array.py(), field, view.len(), &allowed)
    })
}

/// The rows of a table with N columns.
pub fn rows<const N: usize>(field: &str, given: &Given<'_>) -> PyResult<Vec<[f64; N]>> {
    let table: Table<'_> = array(field, given, &format!("an array (n, {N}) of numbers"))?;
    let view = table.as_array();
    let rows: Option<Vec<[f64; N]>> = view.rows().into_iter().map(row).collect();
    rows.ok_or_else(|| {
        let allowed = format!("{N} values per row");
        errors::length(table.py(), field, view.ncols(), &allowed)
    })
}

/// A table from rows.
pub fn table<'py, T: numpy::Element + Copy, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), N])
}

/// A table from columns.
pub fn columns<'py>(
    py: Python<'py>,
    columns: &[impl AsRef<[f64]>],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let height = columns.first().map_or(0, |column| column.as_ref().len());
    let values = (0..height).flat_map(|row| columns.iter().map(move |column| column.as_ref()[row]));
    PyArray1::from_iter(py, values).reshape([height, columns.len()])
}

/// Checks that two arrays that belong together have equal lengths.
pub fn same_length(py: Python<'_>, field: &str, length: usize, expected: usize) -> PyResult<()> {
    if length == expected {
        return Ok(());
    }
    let allowed = format!("{expected} values, one per sample");
    Err(errors::length(py, field, length, &allowed))
}

fn row<const N: usize>(view: ArrayView1<'_, f64>) -> Option<[f64; N]> {
    let mut values = [0.0; N];
    if view.len() != N {
        return None;
    }
    for (value, item) in values.iter_mut().zip(view) {
        *value = *item;
    }
    Some(values)
}

/// An optional covariance (4, 4) of features.
pub fn covariance(given: Option<Given<'_>>) -> PyResult<Option<[[f64; 4]; 4]>> {
    let given = given.as_ref();
    given.map(|given| four("covariance", given)).transpose()
}

/// The four rows of a table, one per feature.
pub fn four<const N: usize>(field: &str, given: &Given<'_>) -> PyResult<[[f64; N]; 4]> {
    let lines = rows(field, given)?;
    let found = lines.len();
    lines
        .try_into()
        .map_err(|_| errors::length(given.py(), field, found, "4 rows"))
}
