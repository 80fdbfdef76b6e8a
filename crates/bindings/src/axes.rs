//! `AxesReduction`: the loop of 1 to 8 DOFs, wrapped by `tautscope.loop.reduction.HysteresisReduction`.

use std::cell::RefCell;

use numpy::{PyArray1, PyArrayLike1, PyArrayLike2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use tautscope_axes::{AxesSettings, BoxedAxes};
use tautscope_core as core;

use crate::arrays::{Table, Vector};
use crate::errors;
use crate::estimator::trigger_names;
use crate::flags;
use crate::reduction::status_name;
use crate::settings::from_mapping;

type Floats<'py> = Bound<'py, PyArray1<f64>>;

/// status, state, `predicted_state`, predicted values, innovation, observable, NaN, `state_deviation`, triggers,
/// `delta_minus`, `delta_plus`.
type Report<'py> = (
    &'static str,
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    Bound<'py, PyArray1<bool>>,
    Floats<'py>,
    Floats<'py>,
    Bound<'py, PyTuple>,
    Floats<'py>,
    Floats<'py>,
);

type Hysteresis<'py> = (
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
);

/// The loop of Fig. 6 for 1 to 8 DOFs and any sensor. Raises `ConfigError`.
#[pyclass(name = "AxesReduction", module = "tautscope._core")]
pub struct AxesReduction(BoxedAxes);

#[pymethods]
impl AxesReduction {
    /// From the configuration of a robot with [[dof]]; without compensation every gain is 1.
    #[new]
    fn new(settings: Bound<'_, PyAny>, compensate: bool) -> PyResult<Self> {
        let py = settings.py();
        let settings: AxesSettings = from_mapping("config", settings)?;
        let made = settings.build(compensate);
        Ok(Self(made.map_err(errors::config(py))?))
    }

    /// One control tick at `time` in s: command (n,) for a reference (n,), which was generated at `stamp` in s.
    #[pyo3(signature = (reference, time, stamp=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        reference: Vector<'py>,
        time: f64,
        stamp: Option<f64>,
    ) -> PyResult<Floats<'py>> {
        let reference = reference.as_array().to_vec();
        self.check(py, "reference", reference.len())?;
        let mut command = vec![f64::NAN; reference.len()];
        self.0.step(&reference, stamp, time, &mut command);
        Ok(PyArray1::from_vec(py, command))
    }

    /// Update by values (m,) of the covariance (m, m), measured at `captured_at` in s: `predict(q)` returns the values that the
    /// sensor would measure in a state (n,) and their derivatives (m, n), or None where it sees nothing. Values are right or
    /// wrong together in groups of `point`; `sensor` is 0 to 3.
    #[pyo3(signature = (values, covariance, captured_at, predict, point, sensor=0))]
    #[expect(clippy::too_many_arguments, reason = "a measurement has as many parts")]
    fn on_reading<'py>(
        &mut self,
        py: Python<'py>,
        values: Vector<'py>,
        covariance: Table<'py>,
        captured_at: f64,
        predict: Bound<'py, PyAny>,
        point: usize,
        sensor: usize,
    ) -> PyResult<Report<'py>> {
        let values = values.as_array().to_vec();
        let count = values.len();
        if count == 0 || count > core::VALUES || covariance.as_array().dim() != (count, count) {
            let allowed = format!(
                "1 to {} values, with a covariance of as many rows",
                core::VALUES
            );
            return Err(errors::length(py, "values", count, &allowed));
        }
        let covariance: Vec<f64> = covariance.as_array().iter().copied().collect();
        let model = Callback {
            predict,
            error: RefCell::new(None),
        };
        let report = self.0.on_reading(&core::Reading {
            values: &values,
            covariance: &covariance,
            point,
            captured_at,
            sensor,
            model: &model,
        });
        if let Some(error) = model.error.into_inner() {
            return Err(error);
        }
        let (dofs, floats) = (self.0.dofs(), |all: &[f64], used: usize| {
            PyArray1::from_slice(py, &all[..used])
        });
        let triggers = report.triggers[..dofs].iter().copied().map(trigger_names);
        Ok((
            status_name(report.status),
            floats(&report.state, dofs),
            floats(&report.predicted_state, dofs),
            floats(&report.predicted, count),
            floats(&report.innovation, count),
            PyArray1::from_slice(py, &report.observable[..dofs]),
            floats(&[f64::NAN; core::DOFS], dofs),
            floats(&report.state_deviation, dofs),
            PyTuple::new(py, triggers.collect::<Vec<_>>())?,
            self.delta_minus(py),
            self.delta_plus(py),
        ))
    }

    /// Reaction, names of the flags that cause it, names of those not acknowledged, and the share of the
    /// compensation in use.
    #[getter]
    fn supervision(&self) -> (&'static str, Vec<&'static str>, Vec<&'static str>, f64) {
        let now = self.0.supervision();
        (
            flags::reaction_name(now.reaction),
            flags::set(now.flags),
            flags::set(now.latched),
            now.lead,
        )
    }

    /// Re-engages the operator input; the first increment of the reference is zero.
    fn engage(&mut self) {
        self.0.engage();
    }

    /// Acknowledges the warnings.
    fn acknowledge(&mut self) {
        self.0.acknowledge();
    }

    /// Uses this share of the compensation, from 0 to 1.
    fn set_compensation(&mut self, py: Python<'_>, share: f64) -> PyResult<()> {
        self.0.set_compensation(share).map_err(errors::config(py))
    }

    /// Raises a flag that only the rig can detect, by its name.
    fn raise_flag(&mut self, py: Python<'_>, name: &str) -> PyResult<()> {
        self.0.raise(flags::flag(py, "flag", name)?);
        Ok(())
    }

    /// The predicted state (n,) now.
    #[getter]
    fn predicted_state<'py>(&self, py: Python<'py>) -> Floats<'py> {
        self.floats(py, &self.0.predicted_state())
    }

    /// Half widths with standard deviations, centres, gains with standard deviations, each (n,).
    #[getter]
    fn hysteresis<'py>(&self, py: Python<'py>) -> Hysteresis<'py> {
        let found = self.0.hysteresis();
        (
            self.floats(py, &found.half_width),
            self.floats(py, &found.width_std),
            self.floats(py, &found.centre),
            self.floats(py, &found.gain),
            self.floats(py, &found.gain_std),
        )
    }

    /// The estimated offsets at the negative contacts (n,), input minus output.
    #[getter]
    fn delta_minus<'py>(&self, py: Python<'py>) -> Floats<'py> {
        self.floats(py, &self.0.play().map(|play| play.delta_minus()))
    }

    /// The estimated offsets at the positive contacts (n,), input minus output.
    #[getter]
    fn delta_plus<'py>(&self, py: Python<'py>) -> Floats<'py> {
        self.floats(py, &self.0.play().map(|play| play.delta_plus()))
    }
}

impl AxesReduction {
    fn floats<'py>(&self, py: Python<'py>, values: &[f64; core::DOFS]) -> Floats<'py> {
        PyArray1::from_slice(py, &values[..self.0.dofs()])
    }

    fn check(&self, py: Python<'_>, field: &str, found: usize) -> PyResult<()> {
        let dofs = self.0.dofs();
        if found == dofs {
            return Ok(());
        }
        let allowed = format!("{dofs} values, one per degree of freedom");
        Err(errors::length(py, field, found, &allowed))
    }
}

/// The model of a sensor in Python, and its first error.
struct Callback<'py> {
    predict: Bound<'py, PyAny>,
    error: RefCell<Option<PyErr>>,
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
