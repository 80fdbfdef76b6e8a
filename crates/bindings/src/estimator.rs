//! `Estimator`.

use numpy::PyArray1;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Vector, same_length};
use crate::description::described_with;
use crate::errors;

type Series<'py> = Bound<'py, PyArray1<f64>>;

/// On-line estimation of one DOF's contact offsets from command and output, Eqs. (4)-(6), Fig. 3.
///
/// `update_distance` (tau) is in the unit of the DOF; `contact_tolerance` (epsilon) and
/// `smoothing_factor` (alpha, per `update_distance` travelled) are between 0 and 1. Command and output
/// must be of the same instant: a delay reads as width. Raises `ConfigError`.
#[pyclass(name = "Estimator", module = "tautscope._core")]
pub struct Estimator {
    pub inner: core::Estimator,
    pub state: core::EstimatorState,
    output: core::PlayState,
}

#[pymethods]
impl Estimator {
    #[new]
    #[pyo3(signature = (
        *, update_distance, contact_tolerance, smoothing_factor, delta_minus, delta_plus
    ))]
    fn new(
        py: Python<'_>,
        update_distance: f64,
        contact_tolerance: f64,
        smoothing_factor: f64,
        delta_minus: f64,
        delta_plus: f64,
    ) -> PyResult<Self> {
        let inner = core::Estimator::new(update_distance, contact_tolerance, smoothing_factor)
            .map_err(errors::config(py))?;
        let play = core::Play::new(delta_minus, delta_plus).map_err(errors::config(py))?;
        Ok(Self {
            inner,
            state: core::EstimatorState::new(play),
            output: core::PlayState { output: f64::NAN },
        })
    }

    /// Updates the offsets from a command and the output measured at the same instant.
    ///
    /// Returns the triggers of (`delta_minus`, `delta_plus`): "contact", Eq. (4), "violation", Eq. (5),
    /// or None. A pair that is not finite is ignored.
    fn update(&mut self, command: f64, measured: f64) -> TriggerNames {
        let triggers = self.inner.update(&mut self.state, command, measured);
        trigger_names(triggers)
    }

    /// The output of the play with the offsets estimated so far, for the next command.
    fn predict(&mut self, command: f64) -> f64 {
        if self.output.output.is_nan() {
            self.output.output = command;
        }
        self.state.play().step(&mut self.output, command)
    }

    /// `predict`, then `update`, for commands (n,) and measured (n,).
    ///
    /// Returns predicted, `delta_minus` and `delta_plus`, each (n,): `predicted[k]` uses `measured[:k]` only,
    /// the offsets are those after sample k. Raises `SignalError` for unequal lengths.
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        commands: Vector<'py>,
        measured: Vector<'py>,
    ) -> PyResult<(Series<'py>, Series<'py>, Series<'py>)> {
        let (commands, measured) = (commands.as_array(), measured.as_array());
        same_length(py, "measured", measured.len(), commands.len())?;
        let mut predicted = Vec::with_capacity(commands.len());
        let mut minus = Vec::with_capacity(commands.len());
        let mut plus = Vec::with_capacity(commands.len());
        for (command, measured) in commands.iter().zip(measured) {
            predicted.push(self.predict(*command));
            self.inner.update(&mut self.state, *command, *measured);
            minus.push(self.delta_minus());
            plus.push(self.delta_plus());
        }
        Ok((
            PyArray1::from_vec(py, predicted),
            PyArray1::from_vec(py, minus),
            PyArray1::from_vec(py, plus),
        ))
    }

    /// Estimated offset at the negative contact, input minus output.
    #[getter]
    fn delta_minus(&self) -> f64 {
        self.state.play().delta_minus()
    }

    /// Estimated offset at the positive contact, input minus output.
    #[getter]
    fn delta_plus(&self) -> f64 {
        self.state.play().delta_plus()
    }

    fn __repr__(&self) -> String {
        described_with(&self.inner, &self.state.play())
    }
}

/// The triggers of `delta_minus` and `delta_plus`.
pub type TriggerNames = (Option<&'static str>, Option<&'static str>);

pub fn trigger_names(triggers: core::Triggers) -> TriggerNames {
    let name = |trigger| match trigger {
        core::Trigger::Contact => "contact",
        core::Trigger::Violation => "violation",
    };
    (triggers.minus.map(name), triggers.plus.map(name))
}
