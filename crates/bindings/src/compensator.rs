//! `Compensator`.

use numpy::PyArray1;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::Vector;
use crate::description::{described, described_with};
use crate::errors;

/// The limited-gain inverse of one DOF's play, Eqs. (2)-(3), Fig. 2.
///
/// Gain 1 in contact, `free_gain` (at least 1, at most `gain_limit`) while the slack is crossed. A
/// slack of width w leaves w / `free_gain`; an over-estimated width overshoots beyond a margin of
/// 1 / (`free_gain` - 1). With `recovery` above 0 the command returns to the reference after changed
/// offsets, by that share of the further travel. Signals are in the unit of the DOF. Raises `ConfigError`.
#[pyclass(name = "Compensator", module = "tautscope._core")]
pub struct Compensator {
    pub inner: core::Compensator,
    state: core::CompensatorState,
}

#[pymethods]
impl Compensator {
    #[new]
    #[pyo3(signature = (*, free_gain, gain_limit, delta_minus, delta_plus, recovery=0.0))]
    fn new(
        py: Python<'_>,
        free_gain: f64,
        gain_limit: f64,
        delta_minus: f64,
        delta_plus: f64,
        recovery: f64,
    ) -> PyResult<Self> {
        let inner = core::Compensator::new(free_gain, gain_limit)
            .and_then(|compensator| compensator.with_recovery(recovery))
            .map_err(errors::config(py))?;
        let play = core::Play::new(delta_minus, delta_plus).map_err(errors::config(py))?;
        let state = core::CompensatorState::new(play);
        Ok(Self { inner, state })
    }

    /// The command c for the next reference u. The first command is the reference; a reference that is
    /// unchanged or not finite repeats the last command.
    fn step(&mut self, reference: f64) -> f64 {
        self.inner.step(&mut self.state, reference)
    }

    /// `step` for references (n,): commands (n,).
    fn run<'py>(&mut self, py: Python<'py>, references: Vector<'py>) -> Bound<'py, PyArray1<f64>> {
        let references = references.as_array();
        let commands = references.iter().map(|reference| self.step(*reference));
        PyArray1::from_iter(py, commands)
    }

    /// Changes the contact offsets (input minus output); the command does not move.
    fn set_offsets(&mut self, py: Python<'_>, delta_minus: f64, delta_plus: f64) -> PyResult<()> {
        let play = core::Play::new(delta_minus, delta_plus).map_err(errors::config(py))?;
        self.inner.retune(&mut self.state, play);
        Ok(())
    }

    /// Changes the gain, 1 for no compensation; the command does not move.
    fn set_gain(&mut self, py: Python<'_>, free_gain: f64, gain_limit: f64) -> PyResult<()> {
        self.inner = self
            .inner
            .with_gain(free_gain, gain_limit)
            .map_err(errors::config(py))?;
        let play = self.state.play();
        self.inner.retune(&mut self.state, play);
        Ok(())
    }

    /// The command c; NaN before the first reference.
    #[getter]
    fn command(&self) -> f64 {
        self.state.command()
    }

    /// p = c - q, the position between the contacts; NaN before the first reference.
    #[getter]
    fn position(&self) -> f64 {
        self.state.position()
    }

    /// The predicted state q: the play model driven by c; NaN before the first reference.
    #[getter]
    fn predicted_state(&self) -> f64 {
        self.state.predicted_state()
    }

    /// Offset at the negative contact, input minus output.
    #[getter]
    fn delta_minus(&self) -> f64 {
        self.state.play().delta_minus()
    }

    /// Offset at the positive contact, input minus output.
    #[getter]
    fn delta_plus(&self) -> f64 {
        self.state.play().delta_plus()
    }

    fn __repr__(&self) -> String {
        let (text, command) = (
            described_with(&self.inner, &self.state.play()),
            self.command(),
        );
        let command = described(&command);
        format!("{}, command={command})", text.trim_end_matches(')'))
    }
}
