//! `StateEstimator`.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Given, fixed, four, rows, same_length, table};
use crate::description::described;
use crate::errors;
use crate::features::FeatureModel;

type Estimate<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<f64>>,
);

type Estimates<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<bool>>);

/// One linear step from prediction to measurement with a check of its rank, Eqs. (13)-(16).
///
/// A DOF whose standard deviation per px of marker noise exceeds its `observable_deviation`
/// [m/px, rad/px] is held at its prediction. Raises `ConfigError`.
#[pyclass(name = "StateEstimator", module = "tautscope._core", frozen)]
pub struct StateEstimator(pub core::StateEstimator);

#[pymethods]
impl StateEstimator {
    #[new]
    #[pyo3(signature = (*, observable_deviation))]
    fn new(py: Python<'_>, observable_deviation: [f64; 3]) -> PyResult<Self> {
        core::StateEstimator::new(observable_deviation)
            .map(Self)
            .map_err(errors::config(py))
    }

    /// State estimate (3,), observable (3,) and standard deviation per px of marker noise (3,) from measured
    /// features (4,) in px, two NaN for a band that was not found.
    fn estimate<'py>(
        &self,
        py: Python<'py>,
        predicted_state: Given<'py>,
        predicted_features: Given<'py>,
        interaction_matrix: Given<'py>,
        measured_features: Given<'py>,
    ) -> PyResult<Estimate<'py>> {
        let [a, b, c, d]: [[f64; 3]; 4] = four("interaction_matrix", &interaction_matrix)?;
        let prediction = core::FeaturePrediction {
            features: fixed("predicted_features", &predicted_features)?,
            columns: [0, 1, 2].map(|dof| [a[dof], b[dof], c[dof], d[dof]]),
        };
        let estimate = self.0.estimate(
            fixed("predicted_state", &predicted_state)?,
            &prediction,
            fixed("measured_features", &measured_features)?,
        );
        Ok((
            PyArray1::from_slice(py, &estimate.state),
            PyArray1::from_slice(py, &estimate.observable),
            PyArray1::from_slice(py, &estimate.deviation),
        ))
    }

    /// Prediction and estimate for states (n, 3) and features (n, 4): estimates (n, 3) and observable (n, 3).
    /// Where a band is not visible, no DOF is observable.
    fn run<'py>(
        &self,
        py: Python<'py>,
        model: &FeatureModel,
        predicted_states: Given<'py>,
        measured_features: Given<'py>,
    ) -> PyResult<Estimates<'py>> {
        let states: Vec<[f64; 3]> = rows("predicted_states", &predicted_states)?;
        let measured: Vec<[f64; 4]> = rows("measured_features", &measured_features)?;
        same_length(py, "measured_features", measured.len(), states.len())?;
        let (estimates, observable): (Vec<_>, Vec<_>) = states
            .into_iter()
            .zip(measured)
            .map(|(state, measured)| match model.0.predict(state) {
                Some(prediction) => {
                    let estimate = self.0.estimate(state, &prediction, measured);
                    (estimate.state, estimate.observable)
                }
                None => (state, [false; 3]),
            })
            .unzip();
        Ok((table(py, &estimates)?, table(py, &observable)?))
    }

    fn __repr__(&self) -> String {
        described(&self.0)
    }
}
