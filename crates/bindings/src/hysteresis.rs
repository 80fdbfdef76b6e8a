//! `Hysteresis`.

use numpy::PyArray2;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Given, fixed, rows, table};
use crate::errors;

/// Hysteresis of the three DOFs with constant parameters, for simulated instruments.
///
/// `half_width` (3,) and `centre` (3,) of the contact offsets, input minus output [m, rad, rad]; `shared`, 0 to 1, is the
/// share of the friction that insertion and rotation have in common; `radius` is the shaft's in m. Raises `ConfigError`.
#[pyclass(name = "Hysteresis", module = "tautscope._core", frozen)]
pub struct Hysteresis {
    hysteresis: core::Hysteresis,
    radius: f64,
}

#[pymethods]
impl Hysteresis {
    #[new]
    #[pyo3(signature = (*, half_width, centre, shared, radius))]
    fn new(
        py: Python<'_>,
        half_width: Given<'_>,
        centre: Given<'_>,
        shared: f64,
        radius: f64,
    ) -> PyResult<Self> {
        let is_positive = |value: &f64| value.is_finite() && *value > 0.0;
        let half_width: [f64; 3] = fixed("half_width", &half_width)?;
        let centre: [f64; 3] = fixed("centre", &centre)?;
        let refuse =
            |field, value: String, allowed| Err(errors::choice(py, field, &value, allowed));
        if !half_width.iter().all(is_positive) {
            return refuse(
                "half_width",
                format!("{half_width:?}"),
                "three numbers above 0",
            );
        }
        if !centre.iter().all(|value| value.is_finite()) {
            return refuse("centre", format!("{centre:?}"), "three finite numbers");
        }
        if !(0.0..=1.0).contains(&shared) {
            return refuse("shared", shared.to_string(), "a number from 0 to 1");
        }
        if !is_positive(&radius) {
            return refuse("radius", radius.to_string(), "a number above 0");
        }
        let hysteresis = core::Hysteresis {
            half_width,
            centre,
            shared,
        };
        Ok(Self { hysteresis, radius })
    }

    /// Tip (n, 3) for commands (n, 3) [m, rad, rad], each a straight motion from the one before; the tip begins in the
    /// middle of the plays.
    fn run<'py>(
        &self,
        py: Python<'py>,
        commands: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let commands = rows::<3>("commands", &commands)?;
        let Some(first) = commands.first() else {
            return table(py, &commands);
        };
        let middle = |dof: usize| first[dof] - self.hysteresis.centre[dof];
        let mut position = core::PlayPosition::at([0, 1, 2].map(middle));
        let mut last = *first;
        let mut tips = Vec::with_capacity(commands.len());
        for command in &commands {
            position = self
                .hysteresis
                .propagate(self.radius, &position, last, *command);
            last = *command;
            tips.push(position.output);
        }
        table(py, &tips)
    }
}
