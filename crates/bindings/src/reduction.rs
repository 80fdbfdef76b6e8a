//! `Reduction`: the loop, wrapped by `tautscope.loop.reduction.HysteresisReduction`.

use std::cell::RefCell;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use tautscope_config::{AnyLoop, AxesSettings, Selection};
use tautscope_core as core;

use crate::arrays::{Given, Table, Vector, covariance as known, fixed, same_length};
use crate::errors;
use crate::estimator::trigger_names;
use crate::flags;
use crate::predict::Callback;
use crate::settings::from_mapping;

type Floats<'py> = Bound<'py, PyArray1<f64>>;

/// status, `state_estimate`, `predicted_state`, predicted features or values, innovation, observable,
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
    Bound<'py, PyTuple>,
    Floats<'py>,
    Floats<'py>,
);

/// The loop of Fig. 6; `tautscope.loop.reduction.HysteresisReduction` is its public face. Raises `ConfigError`.
#[pyclass(name = "Reduction", module = "tautscope._core")]
pub struct Reduction(AnyLoop);

#[pymethods]
impl Reduction {
    /// From the settings of the loop; without compensation every gain is 1 with [[dof]].
    #[new]
    #[pyo3(signature = (settings, compensate=true))]
    fn new(settings: Bound<'_, PyAny>, compensate: bool) -> PyResult<Self> {
        let py = settings.py();
        let selection: Selection = from_mapping("config", settings.clone())?;
        let made = if selection.has_axes() {
            from_mapping::<AxesSettings>("config", settings)?.build(compensate)
        } else {
            selection.build_bands(&from_mapping("config", settings)?)
        };
        made.map(Self).map_err(errors::config(py))
    }

    /// One control tick at `time` in s: command (n,) for a reference (n,), which was generated at `stamp` in s.
    ///
    /// `limit` brings a command within the limits of the actuators: (last, next) to (n,) between them.
    #[pyo3(signature = (reference, time, stamp=None, limit=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        reference: Vector<'py>,
        time: f64,
        stamp: Option<f64>,
        limit: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Floats<'py>> {
        let reference = reference.as_array().to_vec();
        self.check(py, "reference", reference.len())?;
        let mut command = vec![f64::NAN; reference.len()];
        let mut failed = None;
        let mut within = |last: &[f64], next: &mut [f64]| {
            let Some(limit) = limit else { return };
            match limited(py, limit, last, next) {
                Ok(found) => next.copy_from_slice(&found),
                Err(error) => {
                    next.copy_from_slice(last);
                    failed = Some(error);
                }
            }
        };
        self.0
            .step_within(&reference, stamp, time, &mut command, &mut within);
        failed.map_or_else(|| Ok(PyArray1::from_vec(py, command)), Err)
    }

    /// `step` for references (m, n) at times (m,): commands (m, n).
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        references: Table<'py>,
        times: Vector<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (references, times) = (references.as_array(), times.as_array());
        self.check(py, "references", references.ncols())?;
        same_length(py, "times", times.len(), references.nrows())?;
        let mut commands = vec![f64::NAN; references.len()];
        let rows = commands.chunks_exact_mut(self.0.dofs());
        for ((row, command), time) in references.rows().into_iter().zip(rows).zip(times) {
            self.0.step(&row.to_vec(), None, *time, command);
        }
        PyArray1::from_vec(py, commands).reshape(references.dim())
    }

    /// Image update: features (4,) in px, NaN for a band that was not found, and their covariance (4, 4) in
    /// px^2, and a checksum of the image. Returns the fields of `tautscope.loop.reduction.Report` from `status`
    /// to `delta_plus`.
    #[pyo3(signature = (features, captured_at, covariance=None, checksum=None))]
    fn on_features<'py>(
        &mut self,
        py: Python<'py>,
        features: Option<Given<'py>>,
        captured_at: f64,
        covariance: Option<Given<'py>>,
        checksum: Option<u64>,
    ) -> PyResult<Report<'py>> {
        let features = features
            .map(|features| fixed("features", &features))
            .transpose()?;
        let covariance = known(covariance)?;
        let AnyLoop::Bands(inner) = &mut self.0 else {
            return Err(other_sensor(py, "on_features", "a loop without [[dof]]"));
        };
        let report = inner.on_features(features, covariance.as_ref(), captured_at, checksum);
        let estimate = &report.estimate;
        self.report(
            py,
            report.status,
            [
                &estimate.state,
                &report.predicted_state,
                &report.predicted_features,
                &estimate.innovation,
                &estimate.deviation,
                &report.state_deviation,
            ],
            &estimate.observable,
            &report.triggers,
        )
    }

    /// Update by values (m,) of the covariance (m, m), measured at `captured_at` in s: `predict(q)` returns the values that the
    /// sensor would measure in a state (n,) and their derivatives (m, n), or None where it sees nothing. Values are right or
    /// wrong together in groups of `point`; `sensor` is 0 to 3. Returns as `on_features`.
    #[pyo3(signature = (values, covariance, captured_at, predict, point, sensor=0))]
    #[expect(clippy::too_many_arguments, reason = "a measurement has as many parts")]
    fn on_reading<'py>(
        &mut self,
        py: Python<'py>,
        values: Vector<'py>,
        covariance: Table<'py>,
        captured_at: f64,
        predict: Bound<'py, PyAny>,
        point: usize,
        sensor: usize,
    ) -> PyResult<Report<'py>> {
        let values = values.as_array().to_vec();
        let count = values.len();
        if count == 0 || count > core::VALUES || covariance.as_array().dim() != (count, count) {
            let allowed = format!(
                "1 to {} values, with a covariance of as many rows",
                core::VALUES
            );
            return Err(errors::length(py, "values", count, &allowed));
        }
        let covariance: Vec<f64> = covariance.as_array().iter().copied().collect();
        let model = Callback {
            predict,
            error: RefCell::new(None),
        };
        let AnyLoop::Axes(inner) = &mut self.0 else {
            return Err(other_sensor(py, "on_reading", "a loop with [[dof]]"));
        };
        let report = inner.on_reading(&core::Reading {
            values: &values,
            covariance: &covariance,
            point,
            captured_at,
            sensor,
            model: &model,
        });
        if let Some(error) = model.error.into_inner() {
            return Err(error);
        }
        let dofs = self.0.dofs();
        self.report(
            py,
            report.status,
            [
                &report.state[..dofs],
                &report.predicted_state[..dofs],
                &report.predicted[..count],
                &report.innovation[..count],
                &[f64::NAN; core::DOFS][..dofs],
                &report.state_deviation[..dofs],
            ],
            &report.observable[..dofs],
            &report.triggers[..dofs],
        )
    }

    /// Reaction, names of the flags that cause it, names of those not acknowledged, and the share of the
    /// compensation in use.
    #[getter]
    fn supervision(&self) -> (&'static str, Vec<&'static str>, Vec<&'static str>, f64) {
        let now = self.0.supervision();
        (
            flags::reaction_name(now.reaction),
            flags::set(now.flags),
            flags::set(now.latched),
            now.lead,
        )
    }

    /// Re-engages the operator input; the first increment of the reference is zero.
    fn engage(&mut self) {
        self.0.engage();
    }

    /// Acknowledges the warnings.
    fn acknowledge(&mut self) {
        self.0.acknowledge();
    }

    /// Uses this share of the compensation, from 0 to 1.
    fn set_compensation(&mut self, py: Python<'_>, share: f64) -> PyResult<()> {
        self.0.set_compensation(share).map_err(errors::config(py))
    }

    /// Raises a flag that only the rig can detect, by its name.
    fn raise_flag(&mut self, py: Python<'_>, name: &str) -> PyResult<()> {
        self.0.raise(flags::flag(py, "flag", name)?);
        Ok(())
    }

    /// Predicted features (4,) in px at a capture time; None if not known.
    fn predicted_features<'py>(&self, py: Python<'py>, captured_at: f64) -> Option<Floats<'py>> {
        let features = self.bands()?.predicted_features(captured_at)?;
        Some(PyArray1::from_slice(py, &features))
    }

    /// Predicted state (3,) and standard deviations (3,) [m, rad, rad] at a capture time, and the geometry (3,) that images have
    /// found; None if not known.
    fn predict_state<'py>(
        &self,
        py: Python<'py>,
        captured_at: f64,
    ) -> Option<(Floats<'py>, Floats<'py>, Floats<'py>)> {
        let bands = self.bands()?;
        let prior = bands.predict_state(captured_at)?;
        let geometry = bands.geometry().map_or([0.0; 3], |found| found.errors());
        let array = |values| PyArray1::from_slice(py, values);
        Some((
            array(&prior.state),
            array(&prior.deviation),
            array(&geometry),
        ))
    }

    /// The reference that the law follows (n,).
    #[getter]
    fn reference<'py>(&self, py: Python<'py>) -> Floats<'py> {
        self.floats(py, &self.0.reference())
    }

    /// The predicted state (n,) now.
    #[getter]
    fn predicted_state<'py>(&self, py: Python<'py>) -> Floats<'py> {
        self.floats(py, &self.0.predicted_state())
    }

    /// Half widths with standard deviations, centres, gains with standard deviations, each (n,); of the article's instrument
    /// with profile `best` also share of the friction in common, unevenness of the section, and shift of the image (2,) with
    /// standard deviations (2,).
    #[getter]
    fn hysteresis<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let found = self.0.slack();
        let slack = [
            found.half_width,
            found.width_std,
            found.centre,
            found.gain,
            found.gain_std,
        ];
        let mut parts = Vec::new();
        for values in slack {
            parts.push(self.floats(py, &values).into_any());
        }
        if let Some(geometry) = self.bands().and_then(core::BandLoop::geometry) {
            parts.push(geometry.shared.into_bound_py_any(py)?);
            parts.push(geometry.unevenness.into_bound_py_any(py)?);
            parts.push(PyArray1::from_slice(py, &geometry.image_shift).into_any());
            parts.push(PyArray1::from_slice(py, &geometry.image_shift_std).into_any());
        }
        PyTuple::new(py, parts)
    }

    /// The estimated offsets at the negative contacts (n,), input minus output.
    #[getter]
    fn delta_minus<'py>(&self, py: Python<'py>) -> Floats<'py> {
        self.floats(py, &self.0.play().map(|play| play.delta_minus()))
    }

    /// The estimated offsets at the positive contacts (n,), input minus output.
    #[getter]
    fn delta_plus<'py>(&self, py: Python<'py>) -> Floats<'py> {
        self.floats(py, &self.0.play().map(|play| play.delta_plus()))
    }
}

impl Reduction {
    fn bands(&self) -> Option<&(dyn core::BandLoop + Send + Sync)> {
        match &self.0 {
            AnyLoop::Bands(inner) => Some(inner.as_ref()),
            AnyLoop::Axes(_) => None,
        }
    }

    /// The report of an update: `state_estimate`, `predicted_state`, predicted, innovation, deviation, `state_deviation`.
    fn report<'py>(
        &self,
        py: Python<'py>,
        status: core::Status,
        values: [&[f64]; 6],
        observable: &[bool],
        triggers: &[core::Triggers],
    ) -> PyResult<Report<'py>> {
        let [
            state,
            predicted_state,
            predicted,
            innovation,
            deviation,
            std,
        ] = values.map(|values| PyArray1::from_slice(py, values));
        let triggers: Vec<_> = triggers.iter().copied().map(trigger_names).collect();
        Ok((
            status_name(status),
            state,
            predicted_state,
            predicted,
            innovation,
            PyArray1::from_slice(py, observable),
            deviation,
            std,
            PyTuple::new(py, triggers)?,
            self.delta_minus(py),
            self.delta_plus(py),
        ))
    }

    fn floats<'py>(&self, py: Python<'py>, values: &[f64; core::DOFS]) -> Floats<'py> {
        PyArray1::from_slice(py, &values[..self.0.dofs()])
    }

    fn check(&self, py: Python<'_>, field: &str, found: usize) -> PyResult<()> {
        let dofs = self.0.dofs();
        if found == dofs {
            return Ok(());
        }
        let allowed = format!("{dofs} values, one per degree of freedom");
        Err(errors::length(py, field, found, &allowed))
    }
}

/// The command (n,) of the user's limit for the last and the next one.
fn limited(
    py: Python<'_>,
    limit: &Bound<'_, PyAny>,
    last: &[f64],
    next: &[f64],
) -> PyResult<Vec<f64>> {
    let (from, to) = (
        PyArray1::from_slice(py, last),
        PyArray1::from_slice(py, next),
    );
    let found: Vector<'_> = limit.call1((from, to))?.extract()?;
    same_length(py, "limit", found.as_array().len(), next.len())?;
    Ok(found.as_array().to_vec())
}

/// The error of a call that is for another kind of loop.
fn other_sensor(py: Python<'_>, call: &str, allowed: &str) -> PyErr {
    errors::exception(py, "SignalError", call, "another loop", allowed)
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
