//! `Reduction`: the loop, wrapped by `tautscope.loop.reduction.HysteresisReduction`.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tautscope_core as core;

use crate::adaptive::AdaptiveAxis;
use crate::arrays::{Table, Vector, covariance as known, fixed, rows, same_length, table};
use crate::compensator::Compensator;
use crate::errors;
use crate::estimator::{Estimator, TriggerNames, trigger_names};
use crate::features::FeatureModel;
use crate::monitors::{self, Monitors};
use crate::state::StateEstimator;
use crate::weighted::WeightedEstimator;

type Floats<'py> = Bound<'py, PyArray1<f64>>;

/// status, `state_estimate`, `predicted_state`, `predicted_features`, innovation, observable,
/// deviation, `state_deviation`, triggers, `delta_minus`, `delta_plus`.
type Report<'py> = (
    &'static str,
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    Bound<'py, PyArray1<bool>>,
    Floats<'py>,
    Floats<'py>,
    (TriggerNames, TriggerNames, TriggerNames),
    Floats<'py>,
    Floats<'py>,
);

/// The loop of Fig. 6; `tautscope.loop.reduction.HysteresisReduction` is its public face.
#[pyclass(name = "Reduction", module = "tautscope._core")]
pub struct Reduction(core::HysteresisReduction);

#[pymethods]
impl Reduction {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    #[pyo3(signature = (compensators, estimators, model, state_estimator, monitors, *, span, period, start_deviation))]
    fn new(
        py: Python<'_>,
        compensators: [PyRef<'_, Compensator>; 3],
        estimators: [PyRef<'_, Estimator>; 3],
        model: &FeatureModel,
        state_estimator: &StateEstimator,
        monitors: &Monitors,
        span: f64,
        period: f64,
        start_deviation: [f64; 3],
    ) -> PyResult<Self> {
        let axes = [0, 1, 2].map(|dof| {
            let (compensator, estimator) = (&compensators[dof], &estimators[dof]);
            core::Axis::new(compensator.inner, estimator.inner, estimator.state.play())
        });
        let estimation = core::StateEstimation::Article(state_estimator.0);
        let whereabouts = core::Whereabouts::new(core::WhereaboutsSettings {
            start_deviation,
            rest_deviation: [0.0; 3],
            settling_time: 0.0,
        });
        let history = core::History::new(span, period);
        Self::joined(py, axes, model, estimation, history, whereabouts, monitors)
    }

    /// The loop of profile `best`, from its three axes; `friction` is arm, memory and deviation of a
    /// `core::FrictionSettings`.
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    #[pyo3(signature = (axes, model, state_estimator, monitors, *, span, period, start_deviation, rest_deviation, settling_time, friction))]
    fn adaptive(
        py: Python<'_>,
        axes: [PyRef<'_, AdaptiveAxis>; 3],
        model: &FeatureModel,
        state_estimator: &WeightedEstimator,
        monitors: &Monitors,
        span: f64,
        period: f64,
        start_deviation: [f64; 3],
        rest_deviation: [f64; 3],
        settling_time: f64,
        friction: Option<(f64, f64, f64)>,
    ) -> PyResult<Self> {
        let axes = axes.map(|axis| core::Axis::Adaptive(axis.0.clone()));
        let estimation = core::StateEstimation::Weighted(state_estimator.0);
        let whereabouts = core::Whereabouts::new(core::WhereaboutsSettings {
            start_deviation,
            rest_deviation,
            settling_time,
        });
        let history = core::History::new(span, period);
        let Self(inner) =
            Self::joined(py, axes, model, estimation, history, whereabouts, monitors)?;
        let friction = friction.map(|(arm, memory, deviation)| {
            core::Friction::new(core::FrictionSettings {
                arm,
                memory,
                deviation,
            })
        });
        let friction = friction.transpose();
        Ok(Self(
            inner.with_friction(friction.map_err(errors::config(py))?),
        ))
    }

    /// One control tick at `time` in s: reference (3,), made at `stamp` in s, in, command (3,) out.
    #[pyo3(signature = (reference, time, stamp=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        reference: Vector<'py>,
        time: f64,
        stamp: Option<f64>,
    ) -> PyResult<Floats<'py>> {
        let command = self.0.step(fixed("reference", &reference)?, stamp, time);
        Ok(PyArray1::from_slice(py, &command))
    }

    /// `step` for references (n, 3) at times (n,): commands (n, 3).
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        references: Table<'py>,
        times: Vector<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let references: Vec<[f64; 3]> = rows("references", &references)?;
        let times = times.as_array();
        same_length(py, "times", times.len(), references.len())?;
        let commands: Vec<[f64; 3]> = references
            .into_iter()
            .zip(times)
            .map(|(reference, time)| self.0.step(reference, None, *time))
            .collect();
        table(py, &commands)
    }

    /// Image update: features (4,) in px, NaN for a band that was not found, and their covariance (4, 4) in
    /// px^2, and a checksum of the image. Returns the fields of `tautscope.loop.reduction.Report` from `status`
    /// to `delta_plus`.
    #[pyo3(signature = (features, captured_at, covariance=None, checksum=None))]
    fn on_features<'py>(
        &mut self,
        py: Python<'py>,
        features: Option<Vector<'py>>,
        captured_at: f64,
        covariance: Option<Table<'py>>,
        checksum: Option<u64>,
    ) -> PyResult<Report<'py>> {
        let features = features
            .map(|features| fixed("features", &features))
            .transpose()?;
        let covariance = known(covariance)?;
        let report = self
            .0
            .on_features(features, covariance.as_ref(), captured_at, checksum);
        let estimate = &report.estimate;
        let [insertion, rotation, bending] = report.triggers.map(trigger_names);
        Ok((
            status_name(report.status),
            PyArray1::from_slice(py, &estimate.state),
            PyArray1::from_slice(py, &report.predicted_state),
            PyArray1::from_slice(py, &report.predicted_features),
            PyArray1::from_slice(py, &estimate.innovation),
            PyArray1::from_slice(py, &estimate.observable),
            PyArray1::from_slice(py, &estimate.deviation),
            PyArray1::from_slice(py, &report.state_deviation),
            (insertion, rotation, bending),
            self.delta_minus(py),
            self.delta_plus(py),
        ))
    }

    /// Reaction, names of the flags in force, names of those not acknowledged, and the share of the free
    /// gain in use.
    #[getter]
    fn supervision(&self) -> (&'static str, Vec<&'static str>, Vec<&'static str>, f64) {
        let now = self.0.monitors().supervision();
        (
            monitors::reaction_name(now.reaction),
            monitors::set(now.flags),
            monitors::set(now.latched),
            now.lead,
        )
    }

    /// The operator goes on: the first increment of the reference is zero.
    fn engage(&mut self) {
        self.0.monitors_mut().engage();
    }

    /// The operator has seen the warnings.
    fn acknowledge(&mut self) {
        self.0.monitors_mut().acknowledge();
    }

    /// Something only the rig can see, by its name.
    fn raise_flag(&mut self, py: Python<'_>, name: &str) -> PyResult<()> {
        self.0
            .monitors_mut()
            .raise(monitors::flag(py, "flag", name)?);
        Ok(())
    }

    /// Features (4,) in px to expect at a capture time; None if not known.
    fn predicted_features<'py>(&self, py: Python<'py>, captured_at: f64) -> Option<Floats<'py>> {
        let features = self.0.predicted_features(captured_at)?;
        Some(PyArray1::from_slice(py, &features))
    }

    /// Where the instrument should be at a capture time: state (3,) and standard deviations (3,)
    /// [m, rad, rad]; None if not known.
    fn expectation<'py>(
        &self,
        py: Python<'py>,
        captured_at: f64,
    ) -> Option<(Floats<'py>, Floats<'py>)> {
        let belief = self.0.expectation(captured_at)?;
        let array = |values| PyArray1::from_slice(py, values);
        Some((array(&belief.state), array(&belief.deviation)))
    }

    /// The predicted state (3,) now.
    #[getter]
    fn predicted_state<'py>(&self, py: Python<'py>) -> Floats<'py> {
        PyArray1::from_slice(py, &self.0.predicted_state())
    }

    /// The estimated offsets (3,), input minus output.
    #[getter]
    fn delta_minus<'py>(&self, py: Python<'py>) -> Floats<'py> {
        PyArray1::from_slice(py, &self.0.play().map(|play| play.delta_minus()))
    }

    /// The estimated offsets (3,), input minus output.
    #[getter]
    fn delta_plus<'py>(&self, py: Python<'py>) -> Floats<'py> {
        PyArray1::from_slice(py, &self.0.play().map(|play| play.delta_plus()))
    }
}

impl Reduction {
    fn joined(
        py: Python<'_>,
        axes: [core::Axis; 3],
        model: &FeatureModel,
        estimation: core::StateEstimation,
        history: Result<core::History, core::ConfigError>,
        whereabouts: Result<core::Whereabouts, core::ConfigError>,
        monitors: &Monitors,
    ) -> PyResult<Self> {
        Ok(Self(core::HysteresisReduction::new(
            axes,
            model.0,
            estimation,
            history.map_err(errors::config(py))?,
            whereabouts.map_err(errors::config(py))?,
            monitors.0,
        )))
    }
}

fn status_name(status: core::Status) -> &'static str {
    match status {
        core::Status::Ok => "ok",
        core::Status::Held => "held",
        core::Status::Partial => "partial",
        core::Status::NoMarkers => "no_markers",
        core::Status::Stale => "stale",
        core::Status::Duplicate => "duplicate",
        core::Status::Refused => "refused",
    }
}
