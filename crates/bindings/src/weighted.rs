//! `WeightedEstimator`.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Table, Vector, covariance as known, fixed, rows, same_length, table};
use crate::errors;
use crate::features::FeatureModel;
use crate::settings::from_mapping;

type Estimate<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

type Estimates<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<bool>>,
);

/// The state estimate of profile `best`: weighted, iterated, robust to outliers; decision 0018. Raises `ConfigError`.
#[pyclass(name = "WeightedEstimator", module = "tautscope._core", frozen)]
pub struct WeightedEstimator(pub core::WeightedEstimator);

#[pymethods]
impl WeightedEstimator {
    /// From the settings of the loop.
    #[new]
    fn new(settings: Bound<'_, PyAny>) -> PyResult<Self> {
        let py = settings.py();
        let settings: core::Settings = from_mapping("config", settings)?;
        core::WeightedEstimator::from_settings(&settings)
            .map(Self)
            .map_err(errors::config(py))
    }

    /// From a predicted state (3,) with standard deviations (3,) and features (4,) in px, two NaN for
    /// a band that was not found, with covariance (4, 4) in `px^2`: state (3,), its standard deviations (3,),
    /// observable (3,), markers used (2,), and state (3,) and standard deviations (3,) without the prediction.
    ///
    /// None where a band is not visible.
    #[pyo3(signature = (model, predicted_state, std, measured_features, covariance=None))]
    fn estimate<'py>(
        &self,
        py: Python<'py>,
        model: &FeatureModel,
        predicted_state: Vector<'py>,
        std: Vector<'py>,
        measured_features: Vector<'py>,
        covariance: Option<Table<'py>>,
    ) -> PyResult<Option<Estimate<'py>>> {
        let covariance = known(covariance)?;
        let prior = core::Belief {
            state: fixed("predicted_state", &predicted_state)?,
            deviation: fixed("std", &std)?,
        };
        let found = self.0.estimate(
            &model.0,
            &prior,
            fixed("measured_features", &measured_features)?,
            covariance.as_ref(),
        );
        Ok(found.map(|found| {
            let floats = |values| PyArray1::from_slice(py, values);
            (
                floats(&found.estimate.state),
                floats(&found.deviation),
                PyArray1::from_slice(py, &found.estimate.observable),
                PyArray1::from_slice(py, &found.used),
                floats(&found.image_state),
                floats(&found.image_deviation),
            )
        }))
    }

    /// `estimate` for predicted states (n, 3) and features (n, 4), all with equal standard deviations (3,) and
    /// covariance (4, 4): states (n, 3), standard deviations (n, 3), observable (n, 3). Where a band is not
    /// visible, the prediction is returned.
    #[pyo3(signature = (model, predicted_states, std, measured_features, covariance=None))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        model: &FeatureModel,
        predicted_states: Table<'py>,
        std: Vector<'py>,
        measured_features: Table<'py>,
        covariance: Option<Table<'py>>,
    ) -> PyResult<Estimates<'py>> {
        let covariance = known(covariance)?;
        let states: Vec<[f64; 3]> = rows("predicted_states", &predicted_states)?;
        let measured: Vec<[f64; 4]> = rows("measured_features", &measured_features)?;
        same_length(py, "measured_features", measured.len(), states.len())?;
        let std = fixed("std", &std)?;
        let mut found = (Vec::new(), Vec::new(), Vec::new());
        for (state, measured) in states.into_iter().zip(measured) {
            let prior = core::Belief {
                state,
                deviation: std,
            };
            let one = self
                .0
                .estimate(&model.0, &prior, measured, covariance.as_ref());
            let unchanged = (state, std, [false; 3]);
            let (state, std, observable) = one.map_or(unchanged, |one| {
                (one.estimate.state, one.deviation, one.estimate.observable)
            });
            found.0.push(state);
            found.1.push(std);
            found.2.push(observable);
        }
        Ok((
            table(py, &found.0)?,
            table(py, &found.1)?,
            table(py, &found.2)?,
        ))
    }
}
