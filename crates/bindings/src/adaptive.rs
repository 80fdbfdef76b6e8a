//! `AdaptiveAxis`.

use numpy::PyArray1;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::Vector;
use crate::errors;
use crate::estimator::{TriggerNames, trigger_names};
use crate::settings::from_mapping;

/// One DOF of profile `best`: lead law and offset estimate.
///
/// Lengths are in the unit of the DOF. Raises `ConfigError`.
#[pyclass(name = "AdaptiveAxis", module = "tautscope._core")]
pub struct AdaptiveAxis(pub core::AdaptiveAxis);

#[pymethods]
impl AdaptiveAxis {
    /// From the settings of the loop; `dof` is 0 for insertion, 1 for rotation, 2 for bending.
    #[new]
    fn new(settings: Bound<'_, PyAny>, dof: usize) -> PyResult<Self> {
        let py = settings.py();
        let settings: core::Settings = from_mapping("config", settings)?;
        core::AdaptiveAxis::from_settings(&settings, dof)
            .map(Self)
            .map_err(errors::config(py))
    }

    /// The command c for the next reference u. The first command is the reference; a reference that is
    /// unchanged or not finite repeats the last command.
    fn step(&mut self, reference: f64) -> f64 {
        self.0.step(reference)
    }

    /// `step` for references (n,): commands (n,).
    fn run<'py>(&mut self, py: Python<'py>, references: Vector<'py>) -> Bound<'py, PyArray1<f64>> {
        let references = references.as_array();
        let commands = references.iter().map(|reference| self.step(*reference));
        PyArray1::from_iter(py, commands)
    }

    /// Updates the offsets from a command, the output measured at the same instant, its standard
    /// deviation, and the commands since then (n,), oldest first.
    ///
    /// Returns the triggers of (`delta_minus`, `delta_plus`): "contact", "violation" or None.
    fn update_offsets(
        &mut self,
        command: f64,
        measured: f64,
        std: f64,
        commands_since: Vector<'_>,
    ) -> TriggerNames {
        let since = commands_since.as_array();
        trigger_names(self.0.learn(command, measured, std, since.iter().copied()))
    }

    /// The command c; NaN before the first reference.
    #[getter]
    fn command(&self) -> f64 {
        self.0.command()
    }

    /// The predicted state q; NaN before the first reference.
    #[getter]
    fn predicted_state(&self) -> f64 {
        self.0.predicted_state()
    }

    /// Offset at the negative contact at the present reference, input minus output.
    #[getter]
    fn delta_minus(&self) -> f64 {
        self.0.play().delta_minus()
    }

    /// Offset at the positive contact at the present reference, input minus output.
    #[getter]
    fn delta_plus(&self) -> f64 {
        self.0.play().delta_plus()
    }

    /// Travel of the tip over the command's in contact: mean and standard deviation.
    #[getter]
    fn gain(&self) -> (f64, f64) {
        self.0.gain()
    }

    /// Standard deviations of (`delta_minus`, `delta_plus`) at the present reference.
    #[getter]
    fn std(&self) -> (f64, f64) {
        self.0.deviation()
    }
}
