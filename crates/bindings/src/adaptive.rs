//! `AdaptiveAxis`.

use numpy::PyArray1;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::Vector;
use crate::errors;
use crate::estimator::{TriggerNames, trigger_names};

/// One DOF of profile `best`: the lead law and the offsets it learns.
///
/// Lengths are in the unit of the DOF. Raises `ConfigError`.
#[pyclass(name = "AdaptiveAxis", module = "tautscope._core")]
pub struct AdaptiveAxis(pub core::AdaptiveAxis);

#[pymethods]
impl AdaptiveAxis {
    #[new]
    #[pyo3(signature = (
        *, free_gain, contact_gain, cautious_gain, cautious_deviation, gain_limit,
        taper, settling, node_spacing, level_deviation, gain_deviation, local_deviation, correlation,
        level_drift, gain_drift, local_drift, symmetry, change_rate, change_spare,
        known_travel, contact_distance, contact_moved, slope_tolerance, model_deviation,
        state_correction, tremor_time, period, delta_minus, delta_plus
    ))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn new(
        py: Python<'_>,
        free_gain: f64,
        contact_gain: f64,
        cautious_gain: f64,
        cautious_deviation: f64,
        gain_limit: f64,
        taper: f64,
        settling: f64,
        node_spacing: f64,
        level_deviation: f64,
        gain_deviation: f64,
        local_deviation: f64,
        correlation: f64,
        level_drift: f64,
        gain_drift: f64,
        local_drift: f64,
        symmetry: f64,
        change_rate: f64,
        change_spare: f64,
        known_travel: f64,
        contact_distance: f64,
        contact_moved: f64,
        slope_tolerance: f64,
        model_deviation: f64,
        state_correction: f64,
        tremor_time: f64,
        period: f64,
        delta_minus: f64,
        delta_plus: f64,
    ) -> PyResult<Self> {
        let settings = core::AdaptiveSettings {
            law: core::LeadLaw {
                free_gain,
                contact_gain,
                taper,
                settling,
            },
            cautious_gain,
            cautious_deviation,
            prior: core::OffsetPrior {
                spacing: node_spacing,
                level: level_deviation,
                tilt: gain_deviation,
                local: local_deviation,
                correlation,
                level_drift,
                tilt_drift: gain_drift,
                local_drift,
                symmetry,
            },
            change: core::ChangeLimit {
                rate: change_rate,
                spare: change_spare,
                known: known_travel,
            },
            contact: core::ContactTest {
                distance: contact_distance,
                moved: contact_moved,
                tolerance: slope_tolerance,
            },
            model_deviation,
            correction: state_correction,
            gain_limit,
            tremor_time,
            period,
        };
        core::Play::new(delta_minus, delta_plus)
            .and_then(|play| core::AdaptiveAxis::new(settings, play))
            .map(Self)
            .map_err(errors::config(py))
    }

    /// The command c for the next reference u. The first is passed through; an unchanged one, or one
    /// that is not finite, gives the same command again.
    fn step(&mut self, reference: f64) -> f64 {
        self.0.step(reference)
    }

    /// `step` for each of references (n,): commands (n,).
    fn run<'py>(&mut self, py: Python<'py>, references: Vector<'py>) -> Bound<'py, PyArray1<f64>> {
        let references = references.as_array();
        let commands = references.iter().map(|reference| self.step(*reference));
        PyArray1::from_iter(py, commands)
    }

    /// Learn from a command, the output measured at the same instant, its standard deviation per px
    /// of marker noise, and the commands since then (n,), oldest first.
    ///
    /// Returns why (`delta_minus`, `delta_plus`) were updated: "contact", "violation" or None.
    fn learn(
        &mut self,
        command: f64,
        measured: f64,
        deviation: f64,
        since: Vector<'_>,
    ) -> TriggerNames {
        let since = since.as_array();
        trigger_names(
            self.0
                .learn(command, measured, deviation, since.iter().copied()),
        )
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

    /// Offset at the negative contact where the reference is now, input minus output.
    #[getter]
    fn delta_minus(&self) -> f64 {
        self.0.play().delta_minus()
    }

    /// Offset at the positive contact where the reference is now, input minus output.
    #[getter]
    fn delta_plus(&self) -> f64 {
        self.0.play().delta_plus()
    }

    /// Travel of the tip over the command's in contact: mean and standard deviation.
    #[getter]
    fn gain(&self) -> (f64, f64) {
        self.0.gain()
    }

    /// Standard deviations of (`delta_minus`, `delta_plus`) where the reference is now.
    #[getter]
    fn deviation(&self) -> (f64, f64) {
        self.0.deviation()
    }
}
