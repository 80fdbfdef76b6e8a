//! `Compensator`.

use pyo3::prelude::*;
use pyo3::types::PyFloat;
use tautscope_core as core;

use crate::arrays::Given;
use crate::description::{described, described_with};
use crate::errors;
use crate::per_axis::{Axes, PerAxis, shaped};

/// The limited-gain inverse of the plays of 1 to 8 axes, each by itself, Eqs. (2)-(3), Fig. 2.
///
/// Gain 1 in contact, `free_gain` (at least 1, at most `gain_limit`) while the slack is crossed. A
/// slack of width w leaves w / `free_gain`; an over-estimated width overshoots beyond a margin of
/// 1 / (`free_gain` - 1). With `recovery` above 0 the command returns to the reference after changed
/// offsets, by that share of the further travel. Signals are in the unit of the axis. Settings are floats, or arrays (n,) for n
/// axes; signals likewise. Raises `ConfigError`, and `SignalError` for another number of axes.
#[pyclass(name = "Compensator", module = "tautscope._core")]
pub struct Compensator(Axes<(core::Compensator, core::CompensatorState)>);

#[pymethods]
impl Compensator {
    #[new]
    #[pyo3(
        signature = (*, free_gain, gain_limit, delta_minus, delta_plus, recovery=None),
        text_signature = "(*, free_gain, gain_limit, delta_minus, delta_plus, recovery=0.0)"
    )]
    fn new(
        py: Python<'_>,
        free_gain: Given<'_>,
        gain_limit: Given<'_>,
        delta_minus: Given<'_>,
        delta_plus: Given<'_>,
        recovery: Option<Given<'_>>,
    ) -> PyResult<Self> {
        let recovery = recovery.unwrap_or_else(|| PyFloat::new(py, 0.0).into_any());
        let settings = [
            ("free_gain", free_gain),
            ("gain_limit", gain_limit),
            ("delta_minus", delta_minus),
            ("delta_plus", delta_plus),
            ("recovery", recovery),
        ];
        let axes = Axes::new(py, settings, |[free_gain, limit, minus, plus, recovery]| {
            let inner = core::Compensator::new(free_gain, limit)?.with_recovery(recovery)?;
            let play = core::Play::new(minus, plus)?;
            Ok((inner, core::CompensatorState::new(play)))
        });
        axes.map(Self)
    }

    /// The command c for the next reference u. The first command is the reference; a reference that is
    /// unchanged or not finite repeats the last command.
    fn step(&mut self, reference: Given<'_>) -> PyResult<PerAxis> {
        let references = self.0.values("reference", &reference)?;
        let axes = self.0.all.iter_mut().zip(references);
        let commands = axes.map(|((inner, state), reference)| inner.step(state, reference));
        let commands = commands.collect();
        Ok(self.0.pack(commands))
    }

    /// `step` for references (m,), of n axes (m, n): commands likewise.
    fn run<'py>(&mut self, py: Python<'py>, references: Given<'py>) -> PyResult<Bound<'py, PyAny>> {
        let references = self.0.rows("references", &references)?;
        let references = references.as_array();
        let count = self.0.all.len();
        let step = |(index, reference): (usize, &f64)| {
            let (inner, state) = &mut self.0.all[index % count];
            inner.step(state, *reference)
        };
        let commands = references.iter().enumerate().map(step).collect();
        shaped(py, commands, &references)
    }

    /// Changes the contact offsets (input minus output); the command does not move.
    fn set_offsets(
        &mut self,
        py: Python<'_>,
        delta_minus: Given<'_>,
        delta_plus: Given<'_>,
    ) -> PyResult<()> {
        let minus = self.0.values("delta_minus", &delta_minus)?;
        let plus = self.0.values("delta_plus", &delta_plus)?;
        let plays = minus.into_iter().zip(plus);
        let plays: Result<Vec<_>, _> = plays
            .map(|(minus, plus)| core::Play::new(minus, plus))
            .collect();
        let plays = plays.map_err(errors::config(py))?;
        for ((inner, state), play) in self.0.all.iter_mut().zip(plays) {
            inner.retune(state, play);
        }
        Ok(())
    }

    /// The command c; NaN before the first reference.
    #[getter]
    fn command(&self) -> PerAxis {
        self.0.map(|(_, state)| state.command())
    }

    /// p = c - q, the position between the contacts; NaN before the first reference.
    #[getter]
    fn position(&self) -> PerAxis {
        self.0.map(|(_, state)| state.position())
    }

    /// The predicted state q: the play model driven by c; NaN before the first reference.
    #[getter]
    fn predicted_state(&self) -> PerAxis {
        self.0.map(|(_, state)| state.predicted_state())
    }

    /// Offset at the negative contact, input minus output.
    #[getter]
    fn delta_minus(&self) -> PerAxis {
        self.0.map(|(_, state)| state.play().delta_minus())
    }

    /// Offset at the positive contact, input minus output.
    #[getter]
    fn delta_plus(&self) -> PerAxis {
        self.0.map(|(_, state)| state.play().delta_plus())
    }

    fn __repr__(&self) -> String {
        self.0.described(|(inner, state)| {
            let text = described_with(inner, &state.play());
            let command = described(&state.command());
            format!("{}, command={command})", text.trim_end_matches(')'))
        })
    }
}
