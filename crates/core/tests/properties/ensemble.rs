//! The ensemble's update against filters with matrices, and two ensembles with equal inputs.

use crate::estimation::centre_map::CentreMap;
use crate::estimation::ensemble::{Ensemble, STATE, ScalarMeasurement, State};
use proptest::prelude::*;

use super::config;

const NO_MAPS: [CentreMap; 3] = [CentreMap::new(0.0, 1.0); 3];

type Matrix = [[f64; STATE]; STATE];

/// All entries of a measurement's row.
fn row(measurement: &ScalarMeasurement) -> State {
    let mut row = [0.0; STATE];
    row[..3].copy_from_slice(&measurement.output);
    row[12..15].copy_from_slice(&measurement.lag);
    row
}

/// Group of an entry: 0 position, 1 hysteresis of the shaft, 2 of bending.
const fn group(index: usize) -> usize {
    match index {
        0..=4 => 0,
        7 | 10 | 14 => 2,
        _ => 1,
    }
}

/// The part of a row that updates an entry: all of it a position, the group's the hysteresis.
fn localised(index: usize, row: &State) -> State {
    let own = group(index);
    let mut part = *row;
    for (entry, value) in part.iter_mut().enumerate() {
        let of = match entry {
            2 => 2,
            0 | 1 => 1,
            entry => group(entry),
        };
        if own != 0 && of != own {
            *value = 0.0;
        }
    }
    part
}

/// The square root filter with matrices: K of each entry by its own part of the measurement, mean + K (value - y . x),
/// and deviations multiplied by I - reduced K y'.
fn square_root_filter(mean: &mut State, covariance: &mut Matrix, measurement: &ScalarMeasurement) {
    let y = row(measurement);
    let of = |row: &State, y: &State| row.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let all: State = covariance.map(|line| of(&line, &y));
    let total = of(&all, &y) + 1.0;
    let mut gain = [0.0; STATE];
    for (index, (gain, line)) in gain.iter_mut().zip(&*covariance).enumerate() {
        *gain = of(line, &localised(index, &y)) / total;
    }
    let innovation = measurement.value - of(mean, &y);
    let reduced = 1.0 / (1.0 + 1.0 / total.sqrt());
    for (mean, gain) in mean.iter_mut().zip(gain) {
        *mean += gain * innovation;
    }
    let mut factor = [[0.0; STATE]; STATE];
    for (index, (line, gain)) in factor.iter_mut().zip(gain).enumerate() {
        *line = y.map(|y| -reduced * gain * y);
        line[index] += 1.0;
    }
    let times = |a: &Matrix, b: &Matrix| {
        a.map(|row| {
            let mut product = [0.0; STATE];
            for (entry, line) in row.iter().zip(b) {
                for (sum, other) in product.iter_mut().zip(line) {
                    *sum += entry * other;
                }
            }
            product
        })
    };
    let mut transposed = [[0.0; STATE]; STATE];
    for (row, line) in factor.iter().enumerate() {
        for (column, entry) in line.iter().enumerate() {
            transposed[column][row] = *entry;
        }
    }
    *covariance = times(&times(&factor, covariance), &transposed);
}

fn measurements() -> impl Strategy<Value = ScalarMeasurement> {
    let three = || prop::array::uniform3(-2.0..2.0);
    (three(), three(), -5.0..5.0).prop_map(|(output, lag, value)| ScalarMeasurement {
        output,
        lag,
        value,
    })
}

/// Members about a mean, with what motion and noise make of their covariance.
fn ensembles() -> impl Strategy<Value = Ensemble> {
    (
        prop::array::uniform15(-1.0..1.0),
        prop::array::uniform15(0.1..2.0),
        1..u64::MAX,
    )
        .prop_map(|(mean, std, seed)| Ensemble::new(&mean, &std, seed))
}

proptest! {
    #![proptest_config(config())]

    /// In a linear problem mean and covariance are those of the filter with matrices that starts from the ensemble's; of
    /// the position they are the Kalman filter's.
    #[test]
    fn updates_are_those_of_the_square_root_filter(
        mut ensemble in ensembles(), measurements in prop::collection::vec(measurements(), 1..4),
    ) {
        let (mut mean, mut covariance) = ensemble.covariance(|state| *state);
        for measurement in &measurements {
            let (before, old) = (mean, covariance);
            ensemble.update(measurement, [1.0; 2]);
            square_root_filter(&mut mean, &mut covariance, measurement);
            let y = row(measurement);
            let product: Vec<f64> = old.iter().map(|line| (0..STATE).map(|k| line[k] * y[k]).sum()).collect();
            let total = 1.0 + (0..STATE).map(|k| y[k] * product[k]).sum::<f64>();
            let innovation = measurement.value - (0..STATE).map(|k| y[k] * before[k]).sum::<f64>();
            for k in 0..5 {
                prop_assert!((mean[k] - before[k] - product[k] / total * innovation).abs() <= 1e-9);
                for l in 0..5 {
                    let kalman = old[k][l] - product[k] * product[l] / total;
                    prop_assert!((covariance[k][l] - kalman).abs() <= 1e-9, "{k} {l}");
                }
            }
        }
        let (found, spread) = ensemble.covariance(|state| *state);
        for index in 0..STATE {
            prop_assert!((found[index] - mean[index]).abs() <= 1e-9);
            for other in 0..STATE {
                let off = spread[index][other] - covariance[index][other];
                prop_assert!(off.abs() <= 1e-9, "{index} {other}: {off}");
            }
        }
    }

    /// A share of 0 leaves the hysteresis of a group, to the last bit; and the mean moves in proportion to the share.
    #[test]
    fn a_group_is_updated_by_its_share(
        ensemble in ensembles(), measurement in measurements(), shares in prop::array::uniform2(0.0..1.0_f64),
    ) {
        let updated = |shares: [f64; 2]| {
            let mut ensemble = ensemble.clone();
            ensemble.update(&measurement, shares);
            ensemble.mean()
        };
        let (before, all, none, some) = (ensemble.mean(), updated([1.0; 2]), updated([0.0; 2]), updated(shares));
        for index in 0..STATE {
            let share = match group(index) {
                1 => shares[0],
                2 => shares[1],
                _ => 1.0,
            };
            let expected = before[index] + share * (all[index] - before[index]);
            prop_assert!((some[index] - expected).abs() <= 1e-9, "{index}");
            prop_assert_eq!(none[index], if group(index) == 0 { all[index] } else { before[index] }, "{}", index);
        }
    }

    /// Mean and variance are those that were asked for, as far as 64 members have them; the shaft is at the output.
    #[test]
    fn members_are_drawn_with_mean_and_standard_deviation(
        mean in prop::array::uniform15(-1.0..1.0), std in prop::array::uniform15(0.1..2.0), seed in 1..u64::MAX,
    ) {
        let ensemble = Ensemble::new(&mean, &std, seed);
        let (found, covariance) = ensemble.covariance(|state| *state);
        for index in [0, 1, 2].into_iter().chain(5..STATE) {
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
            ensemble.propagate(&NO_MAPS, 1.75, [0.0; 3], path);
            ensemble.update(&measurement, [1.0, 0.5]);
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
    seen(11, 0.0, 1.0);
    for index in 12..15 {
        seen(index, 0.0, 0.4);
    }
    let before = ensemble.mean();
    ensemble.shift_centres([0.1, 0.2, -0.3]);
    for (index, shift) in [(8, 0.1), (9, 0.2), (10, -0.3)] {
        assert!((before[index] - ensemble.mean()[index] - shift).abs() < 1e-12);
    }
}
