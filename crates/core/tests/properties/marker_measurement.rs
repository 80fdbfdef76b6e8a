//! The most probable state for the markers of an image, and its linear measurement.

use crate::estimation::ensemble::ScalarMeasurement;
use crate::estimation::marker_measurement::{ImagePrediction, MarkerEstimate, Markers};
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
        error: [0.3, -0.2, 0.1, 0.4],
        error_covariance: diagonal([0.2; 4]),
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
    let sideways = model.sideways(prior.state).unwrap();
    let mut total = *covariance;
    for row in 0..4 {
        total[row][row] += settings.model_deviation.powi(2);
        for column in 0..4 {
            total[row][column] += prior.error_covariance[row][column]
                + settings.sideways_deviation.powi(2) * sideways[row] * sideways[column];
        }
    }
    let Some(seen) = model.predict(state) else {
        return f64::INFINITY;
    };
    let misfit = [0, 1, 2, 3].map(|k| features[k] - prior.error[k] - seen.features[k]);
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
    let markers = Markers::new(features, Some(covariance), &estimation());
    let found = markers.estimate(model, prior, &estimation())?;
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

    /// The rows of the linear measurement are white: W R W' = I with R of the markers, W from the feature errors' rows.
    #[test]
    fn rows_are_white(
        state in states(), covariance in covariances(), used in prop_oneof![
            Just([true, true]), Just([true, false]), Just([false, true])],
    ) {
        let model = model();
        let Some(seen) = model.predict(state) else { return Ok(()); };
        let mut features = seen.features;
        for (marker, used) in used.into_iter().enumerate() {
            if !used {
                features[2 * marker] = f64::NAN;
                features[2 * marker + 1] = f64::NAN;
            }
        }
        let Some((markers, found)) = estimate(&model, &prediction(state), features, &covariance) else {
            return Ok(());
        };
        prop_assert_eq!(found.used, used);
        let rows = markers.linearize(&found, [0.0; 3], [1.0; 3], [0.0; 3]).unwrap();
        let whitener = rows.map(|row: ScalarMeasurement| row.error);
        let mut total = covariance;
        for (k, row) in total.iter_mut().enumerate() {
            row[k] += estimation().model_deviation.powi(2);
        }
        for a in 0..4 {
            for b in 0..4 {
                let mut sum = 0.0;
                for i in 0..4 {
                    for j in 0..4 {
                        sum += whitener[a][i] * total[i][j] * whitener[b][j];
                    }
                }
                let expected = f64::from(u8::from(a == b && used[a / 2]));
                prop_assert!((sum - expected).abs() <= 1e-9, "{a} {b}: {sum}");
            }
        }
    }

    /// About the estimate, a row's value is its whitened misfit there plus its slope times the output, with gain and origin.
    #[test]
    fn rows_predict_the_features_of_states_nearby(
        state in states(), covariance in covariances(), noise in prop::array::uniform4(-1.0..1.0_f64),
        small in prop::array::uniform3(-1.0..1.0_f64), gain in prop::array::uniform3(0.7..1.2_f64),
    ) {
        let model = model();
        let Some(seen) = model.predict(state) else { return Ok(()); };
        let features = [0, 1, 2, 3].map(|k| seen.features[k] + noise[k]);
        let Some((markers, found)) = estimate(&model, &prediction(state), features, &covariance) else {
            return Ok(());
        };
        prop_assume!(found.used == [true; 2]);
        let origin = [0.02, 0.1, 0.5];
        let rows = markers.linearize(&found, origin, gain, [0.0; 3]).unwrap();
        let tip = [0, 1, 2].map(|dof| found.state[dof] + 1e-3 * small[dof] * STD[dof]);
        let output = [0, 1, 2].map(|dof| origin[dof] + (tip[dof] - origin[dof]) / gain[dof]);
        let there = model.predict(tip).unwrap();
        for row in rows {
            let linear: f64 = row.value - (0..3).map(|dof| row.output[dof] * output[dof]).sum::<f64>();
            let direct: f64 = (0..4).map(|k| row.error[k] * (features[k] - there.features[k])).sum();
            prop_assert!((linear - direct).abs() <= 1e-4, "{linear} {direct}");
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
