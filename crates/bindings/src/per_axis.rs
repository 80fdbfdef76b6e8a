//! A value for each of 1 to 8 axes.

use numpy::ndarray::ArrayViewD;
use numpy::{AllowTypeChange, PyArray1, PyArrayLikeDyn, PyArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyFloat;
use tautscope_core::{ConfigError, DOFS};

use crate::arrays::{Given, array};
use crate::errors;

/// A float for one axis, or an array (n,).
#[derive(Clone)]
pub enum PerAxis {
    One(f64),
    Many(Vec<f64>),
}

impl PerAxis {
    /// The values of an argument.
    pub fn of(field: &str, given: &Given<'_>) -> PyResult<Self> {
        if let Ok(value) = given.cast::<PyFloat>() {
            return Ok(Self::One(value.value()));
        }
        let allowed = "a float, or an array (n,)";
        let array: Samples<'_> = array(field, given, allowed)?;
        let array = array.as_array();
        let values: Vec<f64> = array.iter().copied().collect();
        match array.ndim() {
            0 => Ok(Self::One(array.sum())),
            1 => Ok(Self::Many(values)),
            _ => Err(errors::length(given.py(), field, values.len(), allowed)),
        }
    }
}

impl<'py> IntoPyObject<'py> for PerAxis {
    type Target = PyAny;
    type Output = Bound<'py, PyAny>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Self::Output> {
        match self {
            Self::One(value) => value.into_bound_py_any(py),
            Self::Many(values) => Ok(PyArray1::from_vec(py, values).into_any()),
        }
    }
}

/// Samples (m,) of one axis, or (m, n).
pub type Samples<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// What holds for each axis.
pub struct Axes<T> {
    pub all: Vec<T>,
    is_one: bool,
}

impl<T> Axes<T> {
    /// From K settings, where a float is for all axes.
    pub fn new<const K: usize>(
        py: Python<'_>,
        settings: [(&'static str, Given<'_>); K],
        build: impl Fn([f64; K]) -> Result<T, ConfigError>,
    ) -> PyResult<Self> {
        let mut read = Vec::with_capacity(K);
        for (name, given) in settings {
            read.push((name, PerAxis::of(name, &given)?));
        }
        let count = read.iter().find_map(|(_, value)| match value {
            PerAxis::One(_) => None,
            PerAxis::Many(values) => Some(values.len()),
        });
        let mut axes = Self {
            all: Vec::new(),
            is_one: count.is_none(),
        };
        let count = count.unwrap_or(1);
        let mut columns: [Vec<f64>; K] = std::array::from_fn(|_| Vec::new());
        for (column, (name, value)) in columns.iter_mut().zip(read) {
            *column = match value {
                PerAxis::One(value) => vec![value; count],
                PerAxis::Many(values) => values,
            };
            if !(1..=DOFS).contains(&count) || column.len() != count {
                let allowed = format!("1 to {DOFS} values, as many as of the other settings");
                return Err(errors::length(py, name, column.len(), &allowed));
            }
        }
        let each = (0..count).map(|axis| columns.each_ref().map(|column| column[axis]));
        for settings in each {
            axes.all.push(build(settings).map_err(errors::config(py))?);
        }
        Ok(axes)
    }

    /// The values of a signal for each axis.
    pub fn values(&self, name: &str, given: &Given<'_>) -> PyResult<Vec<f64>> {
        let py = given.py();
        match PerAxis::of(name, given)? {
            PerAxis::One(value) if self.all.len() == 1 => Ok(vec![value]),
            PerAxis::Many(values) if self.all.len() == values.len() => Ok(values),
            PerAxis::One(_) => Err(self.wrong(py, name, 1)),
            PerAxis::Many(values) => Err(self.wrong(py, name, values.len())),
        }
    }

    /// The rows of samples, one value per axis.
    pub fn rows<'py>(&self, name: &str, given: &Given<'py>) -> PyResult<Samples<'py>> {
        let samples: Samples<'_> = array(name, given, "an array of numbers")?;
        let view = samples.as_array();
        match *view.shape() {
            [_] if self.is_one => {}
            [_, axes] if !self.is_one && axes == self.all.len() => {}
            _ => return Err(self.wrong(given.py(), name, view.len())),
        }
        Ok(samples)
    }

    /// A value of each axis.
    pub fn map(&self, value: impl FnMut(&T) -> f64) -> PerAxis {
        self.pack(self.all.iter().map(value).collect())
    }

    /// Values as the settings came: a float for one axis that is no array.
    pub fn pack(&self, values: Vec<f64>) -> PerAxis {
        match values[..] {
            [value] if self.is_one => PerAxis::One(value),
            _ => PerAxis::Many(values),
        }
    }

    /// Text for `__repr__`.
    pub fn described(&self, text: impl Fn(&T) -> String) -> String {
        let texts: Vec<_> = self.all.iter().map(text).collect();
        match texts.as_slice() {
            [text] if self.is_one => text.clone(),
            _ => format!("[{}]", texts.join(", ")),
        }
    }

    fn wrong(&self, py: Python<'_>, name: &str, found: usize) -> PyErr {
        let allowed = format!("{}, one per axis", self.all.len());
        errors::length(py, name, found, &allowed)
    }
}

/// Values as an array of the shape of samples.
pub fn shaped<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    samples: &ArrayViewD<'_, f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let shaped = PyArray1::from_vec(py, values).reshape(samples.shape())?;
    Ok(shaped.into_any())
}
