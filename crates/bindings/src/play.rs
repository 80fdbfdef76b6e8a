//! `Play`.

use numpy::PyArray1;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::Vector;
use crate::errors;

#[pyclass(name = "Play", module = "tautscope._core")]
pub struct Play {
    play: core::Play,
    state: core::PlayState,
}

#[pymethods]
impl Play {
    #[new]
    #[pyo3(signature = (*, delta_minus, delta_plus, output=0.0))]
    fn new(py: Python<'_>, delta_minus: f64, delta_plus: f64, output: f64) -> PyResult<Self> {
        let play = core::Play::new(delta_minus, delta_plus).map_err(errors::config(py))?;
        let state = core::PlayState { output };
        Ok(Self { play, state })
    }

    fn step(&mut self, input: f64) -> f64 {
        self.play.step(&mut self.state, input)
    }

    fn run<'py>(&mut self, py: Python<'py>, inputs: Vector<'py>) -> Bound<'py, PyArray1<f64>> {
        let inputs = inputs.as_array();
        let outputs = inputs.iter().map(|input| self.step(*input));
        PyArray1::from_iter(py, outputs)
    }

    #[getter]
    fn output(&self) -> f64 {
        self.state.output
    }

    #[getter]
    fn delta_minus(&self) -> f64 {
        self.play.delta_minus()
    }

    #[getter]
    fn delta_plus(&self) -> f64 {
        self.play.delta_plus()
    }

    #[getter]
    fn width(&self) -> f64 {
        self.play.width()
    }
}
