//! `Play`.

use numpy::PyArray1;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Given, Vector, array, number};
use crate::description::described_with;
use crate::errors;

/// The play (backlash) operator, Eq. (1): the output lags the input between two contacts.
///
/// `v - delta_plus <= y <= v - delta_minus`, offsets being input minus output; all in one unit. It
/// is rate independent. `output` is the initial output. Raises `ConfigError` for offsets that are
/// not finite or in the wrong order.
#[pyclass(name = "Play", module = "tautscope._core")]
pub struct Play {
    play: core::Play,
    state: core::PlayState,
}

#[pymethods]
impl Play {
    #[new]
    #[pyo3(
        signature = (*, delta_minus, delta_plus, output=None),
        text_signature = "(*, delta_minus, delta_plus, output=0.0)"
    )]
    fn new(
        py: Python<'_>,
        delta_minus: Given<'_>,
        delta_plus: Given<'_>,
        output: Option<Given<'_>>,
    ) -> PyResult<Self> {
        let [minus, plus] = [
            number("delta_minus", &delta_minus)?,
            number("delta_plus", &delta_plus)?,
        ];
        let output = output.map_or(Ok(0.0), |output| number("output", &output))?;
        let play = core::Play::new(minus, plus).map_err(errors::config(py))?;
        let state = core::PlayState { output };
        Ok(Self { play, state })
    }

    /// The output y for the next input v; an input that is not finite leaves it as it is.
    fn step(&mut self, input: Given<'_>) -> PyResult<f64> {
        Ok(self.play.step(&mut self.state, number("input", &input)?))
    }

    /// `step` for inputs (n,): outputs (n,).
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        inputs: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let inputs: Vector<'_> = array("inputs", &inputs, "an array (n,) of numbers")?;
        let inputs = inputs.as_array();
        let outputs = inputs.iter();
        let outputs = outputs.map(|input| self.play.step(&mut self.state, *input));
        Ok(PyArray1::from_iter(py, outputs))
    }

    /// The latest output y.
    #[getter]
    fn output(&self) -> f64 {
        self.state.output
    }

    /// Offset at the negative contact, input minus output.
    #[getter]
    fn delta_minus(&self) -> f64 {
        self.play.delta_minus()
    }

    /// Offset at the positive contact, input minus output.
    #[getter]
    fn delta_plus(&self) -> f64 {
        self.play.delta_plus()
    }

    /// Travel of the input that moves nothing: `delta_plus - delta_minus`.
    #[getter]
    fn width(&self) -> f64 {
        self.play.width()
    }

    fn __repr__(&self) -> String {
        described_with(&self.play, &self.state)
    }
}
