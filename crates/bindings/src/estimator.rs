//! `Estimator`.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use tautscope_core as core;

use crate::arrays::{Given, same_length};
use crate::description::described_with;
use crate::per_axis::{Axes, PerAxis, shaped};

/// On-line estimation of the contact offsets of 1 to 8 axes from command and output, each by itself, Eqs. (4)-(6), Fig. 3.
///
/// `update_distance` (tau) is in the unit of the axis; `contact_tolerance` (epsilon) and
/// `smoothing_factor` (alpha, per `update_distance` travelled) are between 0 and 1. Command and output
/// must be of the same instant: a delay reads as width. Settings are floats, or arrays (n,) for n axes; signals likewise.
/// Raises `ConfigError`, and `SignalError` for another number of axes.
#[pyclass(name = "Estimator", module = "tautscope._core")]
pub struct Estimator(Axes<Axis>);

struct Axis {
    inner: core::Estimator,
    state: core::EstimatorState,
    output: core::PlayState,
}

impl Axis {
    fn predict(&mut self, command: f64) -> f64 {
        if self.output.output.is_nan() {
            self.output.output = command;
        }
        self.state.play().step(&mut self.output, command)
    }
}

#[pymethods]
impl Estimator {
    #[new]
    #[pyo3(signature = (
        *, update_distance, contact_tolerance, smoothing_factor, delta_minus, delta_plus
    ))]
    fn new(
        py: Python<'_>,
        update_distance: Given<'_>,
        contact_tolerance: Given<'_>,
        smoothing_factor: Given<'_>,
        delta_minus: Given<'_>,
        delta_plus: Given<'_>,
    ) -> PyResult<Self> {
        let settings = [
            ("update_distance", update_distance),
            ("contact_tolerance", contact_tolerance),
            ("smoothing_factor", smoothing_factor),
            ("delta_minus", delta_minus),
            ("delta_plus", delta_plus),
        ];
        let axes = Axes::new(
            py,
            settings,
            |[distance, tolerance, factor, minus, plus]| {
                Ok(Axis {
                    inner: core::Estimator::new(distance, tolerance, factor)?,
                    state: core::EstimatorState::new(core::Play::new(minus, plus)?),
                    output: core::PlayState { output: f64::NAN },
                })
            },
        );
        axes.map(Self)
    }

    /// Updates the offsets from a command and the output measured at the same instant.
    ///
    /// Returns the triggers of (`delta_minus`, `delta_plus`): "contact", Eq. (4), "violation", Eq. (5),
    /// or None; of n axes a tuple of n of them. A pair that is not finite is ignored.
    fn update<'py>(
        &mut self,
        py: Python<'py>,
        command: Given<'_>,
        measured: Given<'_>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let is_one = matches!(PerAxis::of("command", &command)?, PerAxis::One(_));
        let commands = self.0.values("command", &command)?;
        let measured = self.0.values("measured", &measured)?;
        let pairs = commands.into_iter().zip(measured);
        let axes = self.0.all.iter_mut().zip(pairs);
        let triggers = axes.map(|(axis, (command, measured))| {
            trigger_names(axis.inner.update(&mut axis.state, command, measured))
        });
        let triggers: Vec<_> = triggers.collect();
        if let ([one], true) = (triggers.as_slice(), is_one) {
            return one.into_bound_py_any(py);
        }
        PyTuple::new(py, triggers).map(Bound::into_any)
    }

    /// The output of the play with the offsets estimated so far, for the next command.
    fn predict(&mut self, command: Given<'_>) -> PyResult<PerAxis> {
        let commands = self.0.values("command", &command)?;
        let axes = self.0.all.iter_mut().zip(commands);
        let outputs = axes.map(|(axis, command)| axis.predict(command)).collect();
        Ok(self.0.pack(outputs))
    }

    /// `predict`, then `update`, for commands (m,) and measured (m,), of n axes (m, n).
    ///
    /// Returns predicted, `delta_minus` and `delta_plus` of this shape: `predicted[k]` uses `measured[:k]` only,
    /// the offsets are those after sample k. Raises `SignalError` for unequal lengths.
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        commands: Given<'py>,
        measured: Given<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let commands = self.0.rows("commands", &commands)?;
        let measured = self.0.rows("measured", &measured)?;
        let (commands, measured) = (commands.as_array(), measured.as_array());
        same_length(py, "measured", measured.len(), commands.len())?;
        let (mut predicted, mut minus, mut plus) = (Vec::new(), Vec::new(), Vec::new());
        let axes = self.0.all.len();
        for (index, (command, measured)) in commands.iter().zip(&measured).enumerate() {
            let axis = &mut self.0.all[index % axes];
            predicted.push(axis.predict(*command));
            axis.inner.update(&mut axis.state, *command, *measured);
            minus.push(axis.state.play().delta_minus());
            plus.push(axis.state.play().delta_plus());
        }
        Ok((
            shaped(py, predicted, &commands)?,
            shaped(py, minus, &commands)?,
            shaped(py, plus, &commands)?,
        ))
    }

    /// Estimated offset at the negative contact, input minus output.
    #[getter]
    fn delta_minus(&self) -> PerAxis {
        self.0.map(|axis| axis.state.play().delta_minus())
    }

    /// Estimated offset at the positive contact, input minus output.
    #[getter]
    fn delta_plus(&self) -> PerAxis {
        self.0.map(|axis| axis.state.play().delta_plus())
    }

    fn __repr__(&self) -> String {
        self.0
            .described(|axis| described_with(&axis.inner, &axis.state.play()))
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
