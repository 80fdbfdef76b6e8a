//! `FeatureModel`.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Given, Vector, columns, fixed, rows, same_length, table};
use crate::camera::Camera;
use crate::description::described;
use crate::errors;
use crate::instrument::Instrument;

type Predictions<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);
type Prediction<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// The feature model h: from the state to the centroids of the two marker bands, Eqs. (9)-(11).
///
/// `translation` in m and `rotation` (rotation vector, rad) are `camera_from_guide`. It predicts the
/// centroid of the visible half of each band (decision 0002). Raises `ConfigError`.
#[pyclass(name = "FeatureModel", module = "tautscope._core", frozen)]
pub struct FeatureModel(pub core::FeatureModel);

#[pymethods]
impl FeatureModel {
    #[new]
    #[pyo3(signature = (instrument, camera, *, translation, rotation))]
    fn new(
        py: Python<'_>,
        instrument: &Instrument,
        camera: &Camera,
        translation: [f64; 3],
        rotation: [f64; 3],
    ) -> PyResult<Self> {
        let pose = core::Pose::new(translation, rotation).map_err(errors::config(py))?;
        Ok(Self(core::FeatureModel::new(instrument.0, camera.0, pose)))
    }

    /// Features (4,) in px and interaction matrix (4, 3) for a state (3,) [m, rad, rad].
    ///
    /// None where a band is not visible.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        state: Given<'py>,
    ) -> PyResult<Option<Prediction<'py>>> {
        let Some(prediction) = self.0.predict(fixed("state", &state)?) else {
            return Ok(None);
        };
        let features = PyArray1::from_slice(py, &prediction.features);
        Ok(Some((features, columns(py, &prediction.columns)?)))
    }

    /// Features (n, 4) in px and interaction matrices (n, 4, 3) for states (n, 3) [m, rad, rad].
    ///
    /// `unevenness` (n,) is half of the difference of the section's curvatures at its ends, over their mean. NaN where a
    /// band is not visible.
    fn predict_all<'py>(
        &self,
        py: Python<'py>,
        states: Given<'py>,
        unevenness: Vector<'py>,
    ) -> PyResult<Predictions<'py>> {
        let (states, unevenness) = (rows::<3>("states", &states)?, unevenness.as_array());
        same_length(py, "unevenness", unevenness.len(), states.len())?;
        let mut features = Vec::with_capacity(states.len());
        let mut matrices = Vec::with_capacity(4 * states.len());
        for (state, unevenness) in states.into_iter().zip(unevenness) {
            let found = self.0.with_geometry([*unevenness, 0.0, 0.0]).predict(state);
            features.push(found.map_or([f64::NAN; 4], |found| found.features));
            let columns = found.map_or([[f64::NAN; 4]; 3], |found| found.columns);
            matrices.extend((0..4).map(|row| columns.map(|column| column[row])));
        }
        let matrices = PyArray1::from_slice(py, matrices.as_flattened());
        let matrices = matrices.reshape([features.len(), 4, 3])?;
        Ok((table(py, &features)?, matrices))
    }

    /// Per band area in px^2, centroid (2,) in px, second moments (2, 2) in px^2 and outline (26, 2) in px.
    ///
    /// None where a band is not visible.
    fn bands<'py>(&self, py: Python<'py>, state: Given<'py>) -> PyResult<Option<Bands<'py>>> {
        let Some(bands) = self.0.bands(fixed("state", &state)?) else {
            return Ok(None);
        };
        let [a, b] = bands.map(|band| {
            let [uu, uv, vv] = band.moments;
            Ok::<_, PyErr>((
                band.area,
                PyArray1::from_slice(py, &band.centroid),
                table(py, &[[uu, uv], [uv, vv]])?,
                table(py, &band.outline)?,
            ))
        });
        Ok(Some((a?, b?)))
    }

    /// The most probable state (3,) and its cost, from a prior state (3,) with standard deviations (3,) and
    /// features (4,) with standard deviations (4,) in px; None where a band is not visible.
    fn nearest_state<'py>(
        &self,
        py: Python<'py>,
        state: Given<'py>,
        state_std: Given<'py>,
        features: Given<'py>,
        std: Given<'py>,
    ) -> PyResult<Option<(Bound<'py, PyArray1<f64>>, f64)>> {
        let prior = core::StatePrior {
            state: fixed("state", &state)?,
            deviation: fixed("state_std", &state_std)?,
        };
        let found =
            self.0
                .nearest_state(&prior, fixed("features", &features)?, fixed("std", &std)?);
        Ok(found.map(|(state, misfit)| (PyArray1::from_slice(py, &state), misfit)))
    }

    fn __repr__(&self) -> String {
        described(&self.0)
    }
}

type Band<'py> = (
    f64,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

type Bands<'py> = (Band<'py>, Band<'py>);
