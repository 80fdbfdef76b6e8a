//! `Reduction`: the loop, wrapped by `tautscope.loop.reduction.HysteresisReduction`.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Table, Vector, covariance as known, fixed, rows, same_length, table};
use crate::errors;
use crate::estimator::{TriggerNames, trigger_names};
use crate::flags;
use crate::settings::from_mapping;

type Floats<'py> = Bound<'py, PyArray1<f64>>;

/// status, `state_estimate`, `predicted_state`, `predicted_features`, innovation, observable,
/// standard deviation per px, `state_deviation`, triggers, `delta_minus`, `delta_plus`.
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

/// The loop with storage for its history on the heap.
type Loop<P> = Box<core::HysteresisReduction<P, Vec<core::Entry>>>;

type Hysteresis<'py> = (
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    Floats<'py>,
    f64,
    f64,
    Floats<'py>,
    Floats<'py>,
);

enum Profile {
    Paper(Loop<core::Paper>),
    Best(Loop<core::Best>),
}

/// Evaluates an expression with the loop of either profile.
macro_rules! on_loop {
    ($reduction:expr, $name:ident => $body:expr) => {
        match $reduction {
            Profile::Paper($name) => $body,
            Profile::Best($name) => $body,
        }
    };
}

/// The loop of Fig. 6; `tautscope.loop.reduction.HysteresisReduction` is its public face. Raises `ConfigError`.
#[pyclass(name = "Reduction", module = "tautscope._core")]
pub struct Reduction(Profile);

#[pymethods]
impl Reduction {
    /// From the settings of the loop, for profile "paper" or "best".
    #[new]
    fn new(settings: Bound<'_, PyAny>, profile: &str) -> PyResult<Self> {
        let py = settings.py();
        let settings: core::Settings = from_mapping("config", settings)?;
        match profile {
            "paper" => build(&settings).map(Profile::Paper),
            "best" => build(&settings).map(Profile::Best),
            _ => {
                return Err(errors::choice(py, "profile", profile, "paper or best"));
            }
        }
        .map(Self)
        .map_err(errors::config(py))
    }

    /// One control tick at `time` in s: command (3,) for a reference (3,), which was generated at `stamp` in s.
    #[pyo3(signature = (reference, time, stamp=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        reference: Vector<'py>,
        time: f64,
        stamp: Option<f64>,
    ) -> PyResult<Floats<'py>> {
        let command = on_loop!(&mut self.0, inner => inner.step(fixed("reference", &reference)?, stamp, time));
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
            .map(|(reference, time)| on_loop!(&mut self.0, inner => inner.step(reference, None, *time)))
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
        let report = on_loop!(&mut self.0, inner => inner.on_features(features, covariance.as_ref(), captured_at, checksum));
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

    /// Reaction, names of the flags that cause it, names of those not acknowledged, and the share of the
    /// compensation in use.
    #[getter]
    fn supervision(&self) -> (&'static str, Vec<&'static str>, Vec<&'static str>, f64) {
        let now = on_loop!(&self.0, inner => inner.supervision());
        (
            flags::reaction_name(now.reaction),
            flags::set(now.flags),
            flags::set(now.latched),
            now.lead,
        )
    }

    /// Re-engages the operator input; the first increment of the reference is zero.
    fn engage(&mut self) {
        on_loop!(&mut self.0, inner => inner.engage());
    }

    /// Acknowledges the warnings.
    fn acknowledge(&mut self) {
        on_loop!(&mut self.0, inner => inner.acknowledge());
    }

    /// Uses this share of the compensation, from 0 to 1.
    fn set_compensation(&mut self, py: Python<'_>, share: f64) -> PyResult<()> {
        on_loop!(&mut self.0, inner => inner.set_compensation(share)).map_err(errors::config(py))
    }

    /// Raises a flag that only the rig can detect, by its name.
    fn raise_flag(&mut self, py: Python<'_>, name: &str) -> PyResult<()> {
        let flag = flags::flag(py, "flag", name)?;
        on_loop!(&mut self.0, inner => inner.raise(flag));
        Ok(())
    }

    /// Predicted features (4,) in px at a capture time; None if not known.
    fn predicted_features<'py>(&self, py: Python<'py>, captured_at: f64) -> Option<Floats<'py>> {
        let features = on_loop!(&self.0, inner => inner.predicted_features(captured_at))?;
        Some(PyArray1::from_slice(py, &features))
    }

    /// Predicted state (3,) and standard deviations (3,) [m, rad, rad] at a capture time, and the geometry (3,) that images have
    /// found; None if not known.
    fn predict_state<'py>(
        &self,
        py: Python<'py>,
        captured_at: f64,
    ) -> Option<(Floats<'py>, Floats<'py>, Floats<'py>)> {
        let prior = on_loop!(&self.0, inner => inner.predict_state(captured_at))?;
        let geometry = on_loop!(&self.0, inner => inner.geometry());
        let array = |values| PyArray1::from_slice(py, values);
        Some((
            array(&prior.state),
            array(&prior.deviation),
            array(&geometry),
        ))
    }

    /// The predicted state (3,) now.
    #[getter]
    fn predicted_state<'py>(&self, py: Python<'py>) -> Floats<'py> {
        PyArray1::from_slice(py, &on_loop!(&self.0, inner => inner.predicted_state()))
    }

    /// In profile `best`: half widths (3,) with standard deviations (3,), centres (3,), gains (3,) with standard
    /// deviations (3,), share of the friction in common, unevenness of the section, and shift of the image (2,) with standard deviations (2,).
    #[getter]
    fn hysteresis<'py>(&self, py: Python<'py>) -> Option<Hysteresis<'py>> {
        let found = match &self.0 {
            Profile::Paper(_) => return None,
            Profile::Best(inner) => inner.hysteresis(),
        };
        let floats = |values| PyArray1::from_slice(py, values);
        Some((
            floats(&found.half_width),
            floats(&found.width_std),
            floats(&found.centre),
            floats(&found.gain),
            floats(&found.gain_std),
            found.shared,
            found.unevenness,
            floats(&found.image_shift),
            floats(&found.image_shift_std),
        ))
    }

    /// The estimated offsets at the negative contacts (3,), input minus output.
    #[getter]
    fn delta_minus<'py>(&self, py: Python<'py>) -> Floats<'py> {
        PyArray1::from_slice(
            py,
            &on_loop!(&self.0, inner => inner.play()).map(|play| play.delta_minus()),
        )
    }

    /// The estimated offsets at the positive contacts (3,), input minus output.
    #[getter]
    fn delta_plus<'py>(&self, py: Python<'py>) -> Floats<'py> {
        PyArray1::from_slice(
            py,
            &on_loop!(&self.0, inner => inner.play()).map(|play| play.delta_plus()),
        )
    }
}

fn build<P: core::BandProfile>(settings: &core::Settings) -> Result<Loop<P>, core::ConfigError> {
    let storage = vec![core::Entry::BLANK; settings.history_entries()];
    core::HysteresisReduction::new(settings, storage).map(Box::new)
}

pub fn status_name(status: core::Status) -> &'static str {
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
