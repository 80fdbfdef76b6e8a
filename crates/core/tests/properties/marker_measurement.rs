//! The most probable state for the markers of an image, and its linear measurement.

use crate::estimation::marker_measurement::{
    ImagePrediction, MarkerEstimate, Markers, TipMeasurement,
};
use crate::estimation::settings::StateEstimationSettings;
use crate::model::features::FeatureModel;
use proptest::prelude::*;

use super::config;
use super::support::loops::model;
use super::support::{safety, settings};

type Square = [[f64; 4]; 4];

const STD: [f64; 3] = [1e-3, 0.08, 0.06];

fn estimation() -> StateEstimationSettings {
    settings(&safety()).state_estimation
}

/// Geometry of the model: unevenness of the section, and shift of the image in px.
const GEOMETRY: [f64; 3] = [0.1, 2.0, -3.0];

fn states() -> impl Strategy<Value = [f64; 3]> {
    (20e-3..32e-3, -1.0..1.0, 0.4..1.2).prop_map(|(a, b, c)| [a, b, c])
}

/// A covariance L L' with correlation.
fn covariances() -> impl Strategy<Value = Square> {
    (
        prop::array::uniform4(0.2..2.0),
        prop::array::uniform6(-0.3..0.3),
    )
        .prop_map(|([a, b, c, d], [e, f, g, h, i, j])| {
            let lower = [
                [a, 0.0, 0.0, 0.0],
                [e, b, 0.0, 0.0],
                [f, g, c, 0.0],
                [h, i, j, d],
            ];
            [0, 1, 2, 3].map(|row| {
                [0, 1, 2, 3].map(|column| (0..4).map(|k| lower[row][k] * lower[column][k]).sum())
            })
        })
}

fn diagonal<const N: usize>(values: [f64; N]) -> [[f64; N]; N] {
    let mut matrix = [[0.0; N]; N];
    for (index, value) in values.into_iter().enumerate() {
        matrix[index][index] = value;
    }
    matrix
}

fn prediction(state: [f64; 3]) -> ImagePrediction {
    ImagePrediction {
        state,
        covariance: diagonal(STD.map(|std| std * std)),
        geometry: GEOMETRY,
        geometry_covariance: [[0.01, 0.05, -0.05], [0.05, 4.0, 0.5], [-0.05, 0.5, 9.0]],
    }
}

/// x in A x = b by Gaussian elimination with pivoting.
fn eliminate(mut rows: Square, mut right: [f64; 4]) -> [f64; 4] {
    for column in 0..4 {
        let pivot = (column..4)
            .max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()))
            .unwrap();
        rows.swap(column, pivot);
        right.swap(column, pivot);
        for row in (0..4).filter(|row| *row != column) {
            let factor = rows[row][column] / rows[column][column];
            let above = rows[column];
            for (entry, above) in rows[row].iter_mut().zip(above) {
                *entry -= factor * above;
            }
            right[row] -= factor * right[column];
        }
    }
    [0, 1, 2, 3].map(|row| right[row] / rows[row][row])
}

/// What is minimised, with both markers, as the documentation has it.
fn cost(
    model: &FeatureModel,
    prior: &ImagePrediction,
    features: [f64; 4],
    covariance: &Square,
    state: [f64; 3],
) -> f64 {
    let settings = estimation();
    let by_geometry = model.by_geometry(prior.state).unwrap();
    let mut total = *covariance;
    for row in 0..4 {
        total[row][row] += settings.model_deviation.powi(2);
        for column in 0..4 {
            for (by, line) in by_geometry.iter().zip(prior.geometry_covariance) {
                for (other, entry) in by_geometry.iter().zip(line) {
                    total[row][column] += by[row] * entry * other[column];
                }
            }
        }
    }
    let Some(seen) = model.predict(state) else {
        return f64::INFINITY;
    };
    let misfit = [0, 1, 2, 3].map(|k| features[k] - seen.features[k]);
    let solved = eliminate(total, misfit);
    let markers: f64 = (0..4).map(|k| misfit[k] * solved[k]).sum();
    let from_prior: f64 = (0..3)
        .map(|k| ((state[k] - prior.state[k]) / STD[k]).powi(2))
        .sum();
    markers + from_prior
}

fn estimate(
    model: &FeatureModel,
    prior: &ImagePrediction,
    features: [f64; 4],
    covariance: &Square,
) -> Option<(Markers, MarkerEstimate)> {
    let markers = Markers::new(
        features,
        Some(covariance),
        &estimation(),
        estimation().model_deviation,
    );
    let found = markers.estimate(model, prior, estimation().outlier_distance)?;
    Some((markers, found))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..config() })]

    /// By a search over a grid about the truth and about what was found, refined: no state is more probable.
    #[test]
    fn no_state_is_more_probable(
        state in states(), away in prop::array::uniform3(-1.5..1.5_f64),
        noise in prop::array::uniform4(-1.0..1.0_f64), covariance in covariances(),
    ) {
        let model = model();
        let prior = prediction([0, 1, 2].map(|dof| state[dof] + away[dof] * STD[dof]));
        let Some(seen) = model.predict(state) else { return Ok(()); };
        let features = [0, 1, 2, 3].map(|k| seen.features[k] + noise[k]);
        let Some((_, found)) = estimate(&model, &prior, features, &covariance) else {
            return Ok(());
        };
        prop_assume!(found.used == [true; 2]);
        let at = |state| cost(&model, &prior, features, &covariance, state);
        prop_assert!((at(found.state) - found.distance_squared).abs() <= 1e-6 * (1.0 + found.distance_squared));
        for centre in [prior.state, found.state] {
            for width in [2.0, 0.5, 0.1, 0.01] {
                for index in 0..343 {
                    let place = [index % 7, index / 7 % 7, index / 49].map(|k: i32| f64::from(k - 3) / 3.0);
                    let trial = [0, 1, 2].map(|dof| centre[dof] + width * place[dof] * STD[dof]);
                    prop_assert!(at(trial) >= found.distance_squared - 1e-4, "{trial:?} {found:?}");
                }
            }
        }
    }

    /// The tip by the markers alone is the estimate with a prediction of 1/0.04 times the variance, where the features are
    /// linear.
    #[test]
    fn the_tip_by_the_markers_has_a_weak_prediction(
        state in states(), away in prop::array::uniform3(-1.0..1.0_f64), covariance in covariances(),
    ) {
        let model = model();
        let small = 1e-3;
        let Some(seen) = model.predict(state) else { return Ok(()); };
        let tiny = ImagePrediction {
            covariance: diagonal(STD.map(|std| (small * std).powi(2))),
            state: [0, 1, 2].map(|dof| state[dof] + small * away[dof] * STD[dof]),
            geometry_covariance: [[0.0; 3]; 3],
            geometry: GEOMETRY,
        };
        let weak = ImagePrediction {
            covariance: tiny.covariance.map(|row| row.map(|entry| entry / 0.04)),
            ..tiny
        };
        let precise = covariance.map(|row| row.map(|entry| small * small * entry));
        let settings = StateEstimationSettings {
            model_deviation: 0.0,
            ..estimation()
        };
        let markers = Markers::new(seen.features, Some(&precise), &settings, 0.0);
        let [Some(one), Some(other)] = [tiny, weak].map(|prior| markers.estimate(&model, &prior, settings.outlier_distance)) else {
            return Ok(());
        };
        for (dof, std) in STD.into_iter().enumerate() {
            let off = (one.measured[dof] - other.state[dof]) / (small * std);
            prop_assert!(off.abs() <= 0.02, "{dof}: {off}");
        }
    }

    /// The rows have the information of the markers: with R of markers, model, geometry and deviation of the tip, and J of the
    /// features by the tip, their sum of a (value - a . tip - what the geometry adds) is J' R^-1 (s - h(tip)), and that of a a' is
    /// J' R^-1 J.
    #[test]
    fn rows_have_the_information_of_the_markers(
        state in states(), covariance in covariances(), noise in prop::array::uniform4(-1.0..1.0_f64),
        small in prop::array::uniform3(-1.0..1.0_f64), deviation in 0.0..0.5_f64, error in prop::array::uniform3(0.0..2.0_f64),
    ) {
        let model = model();
        let Some(seen) = model.predict(state) else { return Ok(()); };
        let features = [0, 1, 2, 3].map(|k| seen.features[k] + noise[k]);
        let Some((markers, found)) = estimate(&model, &prediction(state), features, &covariance) else {
            return Ok(());
        };
        prop_assume!(found.used == [true; 2]);
        let error = [0.1 * error[0], error[1], error[2]];
        let mut geometry = [[0.0; 3]; 3];
        for (index, error) in error.into_iter().enumerate() {
            geometry[index][index] = error * error;
        }
        let std = STD.map(|std| deviation * std);
        let rows = markers.linearize(&found, std, &geometry).unwrap();
        let tip = [0, 1, 2].map(|dof| found.state[dof] + 1e-3 * small[dof] * STD[dof]);
        let columns = found.prediction.columns;
        let mut total = covariance;
        for a in 0..4 {
            total[a][a] += estimation().model_deviation.powi(2);
            for b in 0..4 {
                total[a][b] += (0..3).map(|dof| columns[dof][a] * columns[dof][b] * std[dof].powi(2)).sum::<f64>();
                total[a][b] += (0..3).map(|k| found.by_geometry[k][a] * found.by_geometry[k][b] * geometry[k][k]).sum::<f64>();
            }
        }
        let there = model.predict(tip).unwrap();
        let misfit = eliminate(total, [0, 1, 2, 3].map(|k| features[k] - there.features[k]));
        for dof in 0..3 {
            let right: f64 = rows.iter().map(|row: &TipMeasurement| {
                let rest = row.value - (0..3).map(|k| row.by_tip[k] * tip[k] + row.by_geometry[k] * GEOMETRY[k]).sum::<f64>();
                row.by_tip[dof] * rest
            }).sum();
            let direct: f64 = (0..4).map(|k| columns[dof][k] * misfit[k]).sum();
            prop_assert!(((right - direct) * STD[dof]).abs() <= 1e-2, "{dof}: {right} {direct}");
            for other in 0..3 {
                let product: f64 = rows.iter().map(|row| row.by_tip[dof] * row.by_tip[other]).sum();
                let solved = eliminate(total, columns[other]);
                let direct: f64 = (0..4).map(|k| columns[dof][k] * solved[k]).sum();
                let scale = STD[dof] * STD[other];
                let off = (product - direct) * scale;
                prop_assert!(off.abs() <= 1e-6 * (1.0 + (direct * scale).abs()), "{dof} {other}: {product} {direct}");
            }
        }
    }

    /// With one marker only its two rows count.
    #[test]
    fn a_marker_that_was_not_found_has_no_rows(state in states(), covariance in covariances(), lost in 0..2_usize) {
        let model = model();
        let Some(seen) = model.predict(state) else { return Ok(()); };
        let mut features = seen.features;
        features[2 * lost] = f64::NAN;
        features[2 * lost + 1] = f64::NAN;
        let Some((markers, found)) = estimate(&model, &prediction(state), features, &covariance) else {
            return Ok(());
        };
        prop_assert_eq!(found.used, [lost == 1, lost == 0]);
        let rows = markers.linearize(&found, [0.0; 3], &[[0.0; 3]; 3]).unwrap();
        for row in [rows[2 * lost], rows[2 * lost + 1]] {
            prop_assert_eq!((row.by_tip, row.by_geometry, row.value), ([0.0; 3], [0.0; 3], 0.0));
        }
    }

    /// Of two markers, one that is far off is left out, and the estimate is that of the other alone.
    #[test]
    fn an_outlier_is_left_out(state in states(), wrong in 0..2_usize, far in 60.0..300.0_f64) {
        let model = model();
        let Some(seen) = model.predict(state) else { return Ok(()); };
        let mut features = seen.features;
        features[2 * wrong + 1] += far;
        let covariance = diagonal([0.1; 4]);
        let prior = ImagePrediction {
            covariance: diagonal(STD.map(|std| 0.04 * std * std)),
            ..prediction(state)
        };
        let Some((_, found)) = estimate(&model, &prior, features, &covariance) else {
            return Ok(());
        };
        prop_assert_eq!(found.used, [wrong == 1, wrong == 0]);
        let mut alone = features;
        alone[2 * wrong] = f64::NAN;
        alone[2 * wrong + 1] = f64::NAN;
        let Some((_, one)) = estimate(&model, &prior, alone, &covariance) else {
            return Ok(());
        };
        for (dof, std) in STD.into_iter().enumerate() {
            prop_assert!((found.state[dof] - one.state[dof]).abs() <= 1e-3 * std);
        }
    }
}
