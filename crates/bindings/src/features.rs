//! `FeatureModel`.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Vector, columns, fixed, table};
use crate::camera::Camera;
use crate::errors;
use crate::instrument::Instrument;

type Prediction<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// From the state to the centroids of the two marker bands: h = g after f, Eqs. (9)-(11).
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
    /// None where a band cannot be seen.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        state: Vector<'py>,
    ) -> PyResult<Option<Prediction<'py>>> {
        let Some(prediction) = self.0.predict(fixed("state", &state)?) else {
            return Ok(None);
        };
        let features = PyArray1::from_slice(py, &prediction.features);
        Ok(Some((features, columns(py, &prediction.columns)?)))
    }

    /// Per band area in px^2, centroid (2,) in px, second moments (2, 2) in px^2 and outline (26, 2) in px.
    ///
    /// None where a band cannot be seen.
    fn bands<'py>(&self, py: Python<'py>, state: Vector<'py>) -> PyResult<Option<Bands<'py>>> {
        let Some([a, b]) = self.0.bands(fixed("state", &state)?) else {
            return Ok(None);
        };
        Ok(Some((band(py, &a)?, band(py, &b)?)))
    }

    /// The most probable state (3,) for features (4,) in px of standard deviations (4,), from a belief
    /// (3,) of standard deviations (3,); None where the model sees no band.
    fn nearest_state<'py>(
        &self,
        py: Python<'py>,
        state: Vector<'py>,
        state_deviation: Vector<'py>,
        features: Vector<'py>,
        deviation: Vector<'py>,
    ) -> PyResult<Option<(Bound<'py, PyArray1<f64>>, f64)>> {
        let belief = core::Belief {
            state: fixed("state", &state)?,
            deviation: fixed("state_deviation", &state_deviation)?,
        };
        let found = self.0.nearest_state(
            &belief,
            fixed("features", &features)?,
            fixed("deviation", &deviation)?,
        );
        Ok(found.map(|(state, misfit)| (PyArray1::from_slice(py, &state), misfit)))
    }
}

type Band<'py> = (
    f64,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
);

type Bands<'py> = (Band<'py>, Band<'py>);

fn band<'py>(py: Python<'py>, image: &core::BandImage) -> PyResult<Band<'py>> {
    let [uu, uv, vv] = image.moments;
    Ok((
        image.area,
        PyArray1::from_slice(py, &image.centroid),
        table(py, &[[uu, uv], [uv, vv]])?,
        table(py, &image.outline)?,
    ))
}
