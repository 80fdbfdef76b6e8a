//! The model of a sensor in Python.

use std::cell::RefCell;

use numpy::{PyArray1, PyArrayLike1, PyArrayLike2};
use pyo3::prelude::*;
use tautscope_core as core;

use crate::errors;

/// The model of a sensor in Python, and its first error.
pub struct Callback<'py> {
    pub predict: Bound<'py, PyAny>,
    pub error: RefCell<Option<PyErr>>,
}

impl core::Predict for Callback<'_> {
    fn predict(&self, state: &[f64], values: &mut [f64], jacobian: &mut [f64]) -> bool {
        if self.error.borrow().is_some() {
            return false;
        }
        self.call(state, values, jacobian).unwrap_or_else(|error| {
            self.error.replace(Some(error));
            false
        })
    }
}

impl Callback<'_> {
    fn call(&self, state: &[f64], values: &mut [f64], jacobian: &mut [f64]) -> PyResult<bool> {
        let py = self.predict.py();
        let found = self.predict.call1((PyArray1::from_slice(py, state),))?;
        if found.is_none() {
            return Ok(false);
        }
        let (z, rows): (PyArrayLike1<'_, f64>, PyArrayLike2<'_, f64>) = found.extract()?;
        let (z, rows) = (z.as_array(), rows.as_array());
        if z.len() != values.len() || rows.dim() != (values.len(), state.len()) {
            let allowed = format!("{} values and their derivatives", values.len());
            return Err(errors::length(py, "predict", z.len(), &allowed));
        }
        values.iter_mut().zip(z).for_each(|(to, of)| *to = *of);
        jacobian.iter_mut().zip(rows).for_each(|(to, of)| *to = *of);
        Ok(true)
    }
}
