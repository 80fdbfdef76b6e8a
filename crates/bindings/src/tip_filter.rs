//! `TipFilter`.

use numpy::PyArray1;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Vector, same_length};
use crate::description::described;
use crate::errors;
use crate::settings::from_mapping;

type Run<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

/// The estimate of profile `best` for one DOF whose tip is measured directly.
///
/// The slack is about `expected_width` wide; a measured tip has the standard deviation `std`, both in the unit of the command.
/// Raises `ConfigError`.
#[pyclass(name = "TipFilter", module = "tautscope._core")]
pub struct TipFilter(pub core::AxisFilter);

#[pymethods]
impl TipFilter {
    #[new]
    #[pyo3(signature = (settings, *, expected_width, std))]
    fn new(settings: Bound<'_, PyAny>, expected_width: f64, std: f64) -> PyResult<Self> {
        let py = settings.py();
        let settings: core::Settings = from_mapping("config", settings)?;
        core::AxisFilter::new(settings.estimation, expected_width, std)
            .map(Self)
            .map_err(errors::config(py))
    }

    /// Predicted tip, `delta_minus` and `delta_plus` (n,) for commands (n,) and measured tips (n,), NaN where there is
    /// none; causal: the tip of a sample is predicted before it is measured.
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        commands: Vector<'py>,
        measured: Vector<'py>,
    ) -> PyResult<Run<'py>> {
        let (commands, measured) = (commands.as_array(), measured.as_array());
        same_length(py, "measured", measured.len(), commands.len())?;
        let (mut tips, mut minus, mut plus) = (Vec::new(), Vec::new(), Vec::new());
        for (command, tip) in commands.iter().zip(measured) {
            tips.push(self.0.step(*command));
            self.0.update(*tip);
            let play = self.0.play();
            minus.push(play.delta_minus());
            plus.push(play.delta_plus());
        }
        let array = |values| PyArray1::from_vec(py, values);
        Ok((array(tips), array(minus), array(plus)))
    }

    /// Travel of the tip over that of the command in contact.
    #[getter]
    fn gain(&self) -> f64 {
        self.0.gain()
    }

    fn __repr__(&self) -> String {
        let gain = described(&self.gain());
        described(&self.0.play()).replace("Play(", &format!("TipFilter(gain={gain}, "))
    }
}
