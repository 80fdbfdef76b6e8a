//! The ensemble's update against a plain Kalman filter, and two ensembles with equal inputs.

use crate::estimation::centre_map::CentreMap;
use crate::estimation::ensemble::{Ensemble, STATE, ScalarMeasurement, State};
use proptest::prelude::*;

use super::config;

const NO_MAPS: [CentreMap; 3] = [CentreMap::new(0.0, 1.0); 3];

type Matrix = [[f64; STATE]; STATE];

/// All entries of a measurement's row: outputs first.
fn row(measurement: &ScalarMeasurement) -> State {
    let mut row = [0.0; STATE];
    row[..3].copy_from_slice(&measurement.output);
    row
}

/// The textbook: K = P y / (y' P y + 1), x += K (value - y . x), P -= K y' P.
fn kalman(mean: &mut State, covariance: &mut Matrix, measurement: &ScalarMeasurement) {
    let y = row(measurement);
    let product: Vec<f64> = covariance
        .iter()
        .map(|line| line.iter().zip(y).map(|(p, y)| p * y).sum())
        .collect();
    let variance: f64 = product.iter().zip(y).map(|(p, y)| p * y).sum();
    let predicted: f64 = mean.iter().zip(y).map(|(x, y)| x * y).sum();
    for (index, gain) in product.iter().map(|p| p / (variance + 1.0)).enumerate() {
        mean[index] += gain * (measurement.value - predicted);
        for (entry, p) in covariance[index].iter_mut().zip(&product) {
            *entry -= gain * p;
        }
    }
}

fn measurements() -> impl Strategy<Value = ScalarMeasurement> {
    (prop::array::uniform3(-2.0..2.0), -5.0..5.0)
        .prop_map(|(output, value)| ScalarMeasurement { output, value })
}

/// Members about a mean, with what motion and noise make of their covariance.
fn ensembles() -> impl Strategy<Value = Ensemble> {
    (
        prop::array::uniform12(-1.0..1.0),
        prop::array::uniform12(0.1..2.0),
        1..u64::MAX,
    )
        .prop_map(|(mean, std, seed)| Ensemble::new(&mean, &std, seed))
}

proptest! {
    #![proptest_config(config())]

    /// In a linear problem mean and covariance are those of the Kalman filter that starts from the ensemble's.
    #[test]
    fn updates_are_those_of_the_kalman_filter(
        mut ensemble in ensembles(), measurements in prop::collection::vec(measurements(), 1..8),
    ) {
        let (mut mean, mut covariance) = ensemble.covariance(|state| *state);
        for measurement in &measurements {
            ensemble.update(measurement, false);
            kalman(&mut mean, &mut covariance, measurement);
        }
        let (found, spread) = ensemble.covariance(|state| *state);
        for index in 0..STATE {
            prop_assert!((found[index] - mean[index]).abs() <= 1e-9);
            prop_assert!((ensemble.mean()[index] - mean[index]).abs() <= 1e-9);
            for other in 0..STATE {
                let off = spread[index][other] - covariance[index][other];
                prop_assert!(off.abs() <= 1e-9, "{index} {other}: {off}");
            }
        }
    }

    /// Of the position only: what describes the hysteresis stays, to the last bit.
    #[test]
    fn an_update_of_the_position_leaves_the_parameters(ensemble in ensembles(), measurement in measurements()) {
        let (mut all, mut position) = (ensemble.clone(), ensemble.clone());
        all.update(&measurement, false);
        position.update(&measurement, true);
        for index in 0..STATE {
            let expected = if index < 5 { all.mean() } else { ensemble.mean() };
            prop_assert_eq!(position.mean()[index], expected[index], "{}", index);
        }
    }

    /// Mean and variance are those that were asked for, as far as 64 members have them; the shaft is at the output.
    #[test]
    fn members_are_drawn_with_mean_and_standard_deviation(
        mean in prop::array::uniform12(-1.0..1.0), std in prop::array::uniform12(0.1..2.0), seed in 1..u64::MAX,
    ) {
        let ensemble = Ensemble::new(&mean, &std, seed);
        let (found, covariance) = ensemble.covariance(|state| *state);
        for index in [0, 1, 2, 5, 6, 7, 8, 9, 10, 11] {
            let off = (found[index] - mean[index]) / std[index];
            let ratio = covariance[index][index].sqrt() / std[index];
            // Five standard deviations of the mean and of the standard deviation of 64 numbers.
            prop_assert!(off.abs() <= 5.0 / 8.0 && (ratio - 1.0).abs() <= 5.0 / 11.0, "{index}: {off}, {ratio}");
        }
        for (output, shaft) in [(0, 3), (1, 4)] {
            prop_assert_eq!(covariance[output][output], covariance[shaft][shaft]);
            prop_assert_eq!(covariance[output][output], covariance[output][shaft]);
        }
    }

    /// Equal inputs give equal members, bit for bit.
    #[test]
    fn an_ensemble_is_deterministic(
        ensemble in ensembles(), measurement in measurements(), command in prop::array::uniform3(-3.0..3.0),
    ) {
        let run = |mut ensemble: Ensemble| {
            ensemble.disturb_position([0.1, 0.2, 0.3]);
            let path = [[0.1; 3], command].into_iter();
            ensemble.propagate(&NO_MAPS, 1.75, [0.0; 3], &path);
            ensemble.update(&measurement, false);
            ensemble.add_noise(&[0.1; STATE]);
            ensemble.limit([0.1; 3], [2.0; 3]);
            ensemble
        };
        let (one, other) = (run(ensemble.clone()), run(ensemble.clone()));
        prop_assert_eq!(one.mean().map(f64::to_bits), other.mean().map(f64::to_bits));
        prop_assert!(one == other);
        prop_assert!(one != ensemble);
    }
}

#[test]
fn parameters_are_kept_within_their_limits() {
    let mut mean = [0.0; STATE];
    mean[11] = 3.0;
    let mut ensemble = Ensemble::new(&mean, &[4.0; STATE], 7);
    ensemble.limit([0.5, 0.6, 0.7], [2.0, 3.0, 4.0]);
    let seen = |index: usize, least: f64, largest: f64| {
        let (low, high) = (
            ensemble
                .covariance(|state| [f64::from(u8::from(state[index] < least - 1e-12))])
                .0[0],
            ensemble
                .covariance(|state| [f64::from(u8::from(state[index] > largest + 1e-12))])
                .0[0],
        );
        assert_eq!((low, high), (0.0, 0.0), "{index}");
    };
    for (index, least, largest) in [(5, 0.5_f64, 2.0_f64), (6, 0.6, 3.0), (7, 0.7, 4.0)] {
        seen(index, least.ln(), largest.ln());
    }
    seen(11, -5.0, 5.0);
    let before = ensemble.mean();
    ensemble.shift_centres([0.1, 0.2, -0.3]);
    for (index, shift) in [(8, 0.1), (9, 0.2), (10, -0.3)] {
        assert!((before[index] - ensemble.mean()[index] - shift).abs() < 1e-12);
    }
}
