//! `Compensator`.

use numpy::PyArray1;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::Vector;
use crate::errors;

#[pyclass(name = "Compensator", module = "tautscope._core")]
pub struct Compensator {
    pub inner: core::Compensator,
    state: core::CompensatorState,
}

#[pymethods]
impl Compensator {
    #[new]
    #[pyo3(signature = (*, free_gain, gain_limit, delta_minus, delta_plus))]
    fn new(
        py: Python<'_>,
        free_gain: f64,
        gain_limit: f64,
        delta_minus: f64,
        delta_plus: f64,
    ) -> PyResult<Self> {
        let inner = core::Compensator::new(free_gain, gain_limit).map_err(errors::config(py))?;
        let play = core::Play::new(delta_minus, delta_plus).map_err(errors::config(py))?;
        let state = core::CompensatorState::new(play);
        Ok(Self { inner, state })
    }

    fn step(&mut self, reference: f64) -> f64 {
        self.inner.step(&mut self.state, reference)
    }

    fn run<'py>(&mut self, py: Python<'py>, references: Vector<'py>) -> Bound<'py, PyArray1<f64>> {
        let references = references.as_array();
        let commands = references.iter().map(|reference| self.step(*reference));
        PyArray1::from_iter(py, commands)
    }

    fn set_offsets(&mut self, py: Python<'_>, delta_minus: f64, delta_plus: f64) -> PyResult<()> {
        let play = core::Play::new(delta_minus, delta_plus).map_err(errors::config(py))?;
        self.inner.retune(&mut self.state, play);
        Ok(())
    }

    fn set_gain(&mut self, py: Python<'_>, free_gain: f64, gain_limit: f64) -> PyResult<()> {
        self.inner = core::Compensator::new(free_gain, gain_limit).map_err(errors::config(py))?;
        let play = self.state.play();
        self.inner.retune(&mut self.state, play);
        Ok(())
    }

    #[getter]
    fn command(&self) -> f64 {
        self.state.command()
    }

    #[getter]
    fn position(&self) -> f64 {
        self.state.position()
    }

    #[getter]
    fn predicted_state(&self) -> f64 {
        self.state.predicted_state()
    }

    #[getter]
    fn delta_minus(&self) -> f64 {
        self.state.play().delta_minus()
    }

    #[getter]
    fn delta_plus(&self) -> f64 {
        self.state.play().delta_plus()
    }
}
