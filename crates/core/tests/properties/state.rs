//! Eqs. (13)-(16), and the rank watch. The comparison with numpy's pinv is among Python's tests.

use crate::article::state::StateEstimator;
use crate::model::features::FeaturePrediction;
use proptest::prelude::*;

use super::config;
use super::linear::eliminate;

fn prediction(columns: [[f64; 4]; 3]) -> FeaturePrediction {
    FeaturePrediction {
        features: [0.0; 4],
        columns,
    }
}

fn columns() -> impl Strategy<Value = [[f64; 4]; 3]> {
    prop::array::uniform3(prop::array::uniform4(-100.0..100.0))
}

fn image(columns: [[f64; 4]; 3], state: [f64; 3]) -> [f64; 4] {
    [0, 1, 2, 3].map(|row| (0..3).map(|dof| columns[dof][row] * state[dof]).sum())
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_consistent_innovation_recovers_the_state(
        columns in columns(), state in prop::array::uniform3(-1.0..1.0)
    ) {
        let all = StateEstimator::new([1e9; 3]).unwrap();
        let found = all.estimate([0.0; 3], &prediction(columns), image(columns, state));
        let worst = found.deviation.iter().copied().fold(0.0, f64::max);
        for (found, state) in found.state.iter().zip(state) {
            prop_assert!((found - state).abs() <= 1e-12 * (1.0 + worst * 100.0), "{} {}", found, state);
        }
    }

    #[test]
    fn a_held_dof_stays_and_the_rest_is_solved_without_it(
        columns in columns(), innovation in prop::array::uniform4(-10.0..10.0), held in 0_usize..3
    ) {
        let mut limits = [1e9; 3];
        limits[held] = 1e-9;
        let watch = StateEstimator::new(limits).unwrap();
        let found = watch.estimate([0.5; 3], &prediction(columns), innovation);
        prop_assert_eq!(found.state[held], 0.5);
        for dof in 0..3 {
            prop_assert_eq!(found.observable[dof], dof != held);
        }
        // Least squares: what is left is across every column that was used.
        let mut step = found.state.map(|value| value - 0.5);
        step[held] = 0.0;
        let explained = image(columns, step);
        for dof in (0..3).filter(|dof| *dof != held) {
            let left: f64 = (0..4)
                .map(|row| columns[dof][row] * (innovation[row] - explained[row]))
                .sum();
            prop_assert!(left.abs() <= 1e-8, "{}", left);
        }
    }

    /// (L' L)^-1 by elimination: its diagonal is the variance per px, and times L' it is the pseudo-inverse P.
    #[test]
    fn all_outputs_agree_with_the_normal_equations(
        columns in columns(), innovation in prop::array::uniform4(-10.0..10.0),
        roots in prop::array::uniform4(prop::array::uniform4(-1.0..1.0_f64))
    ) {
        let product = |a: [f64; 4], b: [f64; 4]| -> f64 { (0..4).map(|k| a[k] * b[k]).sum() };
        let normal = columns.map(|a| columns.map(|b| product(a, b)));
        let unit = |k: usize| [0, 1, 2].map(|j| if j == k { 1.0 } else { 0.0 });
        let inverse = [0, 1, 2].map(|k| eliminate(normal, unit(k)));
        let size = inverse.as_flattened().iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        prop_assume!(size < 0.01);
        // A covariance R R'.
        let covariance = roots.map(|a| roots.map(|b| product(a, b)));

        let predicted = [0.5, -1.0, 2.0];
        let mut measured = prediction(columns).features;
        for (measured, innovation) in measured.iter_mut().zip(innovation) {
            *measured += innovation;
        }
        let all = StateEstimator::new([1e9, 1e8, 1e7]).unwrap();
        let found = all.estimate(predicted, &prediction(columns), measured);
        let deviations = found.state_deviation(&covariance);
        for dof in 0..3 {
            let row = [0, 1, 2, 3].map(|k| -> f64 { (0..3).map(|j| inverse[dof][j] * columns[j][k]).sum() });
            let state = predicted[dof] + product(row, found.innovation);
            let variance = product(row, covariance.map(|line| product(line, row)));
            prop_assert!(found.observable[dof]);
            prop_assert!((found.state[dof] - state).abs() <= 1e-8);
            prop_assert!((found.deviation[dof] - inverse[dof][dof].sqrt()).abs() <= 1e-8);
            prop_assert!((deviations[dof] - variance.sqrt()).abs() <= 1e-6);
            for (found, expected) in found.inverse[dof].iter().zip(row) {
                prop_assert!((found - expected).abs() <= 1e-8);
            }
        }
    }

    /// Of two bands one is enough for two DOFs: two equations, solved exactly by what the other band does not enter.
    #[test]
    fn a_band_that_was_not_found_has_no_influence(
        columns in columns(), [u, v] in prop::array::uniform2(-10.0..10.0_f64), held in 0_usize..3,
        first in any::<bool>()
    ) {
        let mut limits = [1e9; 3];
        limits[held] = 1e-9;
        let watch = StateEstimator::new(limits).unwrap();
        let (none, place) = (f64::NAN, if first { 0 } else { 2 });
        let measured = if first { [u, v, none, none] } else { [none, none, u, v] };
        let found = watch.estimate([0.0; 3], &prediction(columns), measured);
        prop_assert!(!found.observable[held] && found.inverse[held] == [0.0; 4]);
        let used: Vec<usize> = (0..3).filter(|dof| *dof != held).collect();
        let [a, b] = [columns[used[0]], columns[used[1]]];
        // Cramer's rule.
        let determinant = a[place] * b[place + 1] - a[place + 1] * b[place];
        prop_assume!(determinant.abs() > 10.0);
        let state = [
            (u * b[place + 1] - v * b[place]) / determinant,
            (v * a[place] - u * a[place + 1]) / determinant,
        ];
        let mut covariance = [[f64::NAN; 4]; 4];
        covariance[place][place] = 4.0;
        covariance[place + 1][place + 1] = 9.0;
        covariance[place][place + 1] = 0.0;
        covariance[place + 1][place] = 0.0;
        let deviations = found.state_deviation(&covariance);
        prop_assert!(deviations[held].is_nan());
        let rows = [
            [b[place + 1], -b[place]].map(|value| value / determinant),
            [-a[place + 1], a[place]].map(|value| value / determinant),
        ];
        for ((dof, state), row) in used.into_iter().zip(state).zip(rows) {
            prop_assert!(found.observable[dof]);
            prop_assert!((found.state[dof] - state).abs() <= 1e-8);
            prop_assert!((deviations[dof] - (2.0 * row[0]).hypot(3.0 * row[1])).abs() <= 1e-8);
        }
    }

    #[test]
    fn units_do_not_matter(columns in columns(), scale in 1e-6..1e6_f64) {
        let plain = StateEstimator::new([0.02; 3]).unwrap();
        let other = StateEstimator::new([0.02 * scale, 0.02, 0.02]).unwrap();
        let mut scaled = columns;
        scaled[0] = scaled[0].map(|value| value / scale);
        let innovation = [1.0, -2.0, 3.0, 0.5];
        let a = plain.estimate([0.0; 3], &prediction(columns), innovation);
        let b = other.estimate([0.0; 3], &prediction(scaled), innovation);
        prop_assert_eq!(a.observable, b.observable);
        prop_assert!((a.state[0] * scale - b.state[0]).abs() <= 1e-9 * scale);
    }
}

#[test]
fn a_zero_or_repeated_column_is_held() {
    let watch = StateEstimator::new([1.0; 3]).unwrap();
    let (x, y) = ([1e3, 0.0, 0.0, 0.0], [0.0, 1e3, 0.0, 0.0]);
    let none = watch.estimate([0.0; 3], &prediction([x, [0.0; 4], y]), [1.0; 4]);
    assert_eq!(none.observable, [true, false, true]);
    assert_eq!(none.deviation[1], f64::INFINITY);
    let twice = watch.estimate([0.0; 3], &prediction([x, x, y]), [1.0; 4]);
    assert_eq!(
        twice.observable,
        [false, true, true],
        "of two alike the first"
    );
}

/// Of three unit vectors each is known to 1 per px, and the limit is 1.
#[test]
fn a_dof_exactly_at_its_limit_is_observable() {
    let watch = StateEstimator::new([1.0; 3]).unwrap();
    let mut units = [[0.0; 4]; 3];
    for (dof, column) in units.iter_mut().enumerate() {
        column[dof] = 1.0;
    }
    let found = watch.estimate([0.0; 3], &prediction(units), [1.0, 2.0, 3.0, 4.0]);
    assert_eq!((found.observable, found.deviation), ([true; 3], [1.0; 3]));
    assert_eq!(found.state, [1.0, 2.0, 3.0]);
}

#[test]
fn no_dof_is_observable_if_an_input_is_not_finite() {
    let watch = StateEstimator::new([1.0; 3]).unwrap();
    let good = [
        [1e3, 0.0, 0.0, 0.0],
        [0.0, 1e3, 0.0, 0.0],
        [0.0, 0.0, 1e3, 0.0],
    ];
    let mut bad = good;
    bad[2][3] = f64::INFINITY;
    let huge = good.map(|column| column.map(|value| value * 1e200));
    let cases = [
        watch.estimate([0.5; 3], &prediction(good), [1.0, f64::NAN, 1.0, 1.0]),
        watch.estimate([0.5; 3], &prediction(bad), [1.0; 4]),
        watch.estimate([0.5; 3], &prediction(huge), [1.0; 4]),
    ];
    for found in cases {
        assert_eq!((found.state, found.observable), ([0.5; 3], [false; 3]));
    }
    // One NaN of a band is no band that was not found.
    for entry in 0..4 {
        let mut measured = [1.0; 4];
        measured[entry] = f64::NAN;
        let found = watch.estimate([0.5; 3], &prediction(good), measured);
        assert_eq!((found.state, found.observable), ([0.5; 3], [false; 3]));
    }
    assert_eq!(StateEstimator::new([1.0, 0.0, 1.0]).unwrap_err().value, 0.0);
}

#[test]
fn the_least_observable_dof_is_held_first() {
    let nearly_the_same = [[1e3, 0.0, 0.0, 0.0], [1e3, 1.0, 0.0, 0.0]];
    let [a, b] = nearly_the_same;
    let c = [0.0, 0.0, 1e3, 0.0];
    let watch = StateEstimator::new([0.1, 0.5, 0.5]).unwrap();
    let found = watch.estimate([0.0; 3], &prediction([a, b, c]), [1.0; 4]);
    assert_eq!(found.observable, [false, true, true]);
    let watch = StateEstimator::new([0.5, 0.1, 0.5]).unwrap();
    let found = watch.estimate([0.0; 3], &prediction([a, b, c]), [1.0; 4]);
    assert_eq!(found.observable, [true, false, true]);
    // The limit itself: alone, c is known to 1e-3 per px.
    for (limit, observable) in [(1.01e-3, true), (0.99e-3, false)] {
        let watch = StateEstimator::new([1.0, 1.0, limit]).unwrap();
        let found = watch.estimate([0.0; 3], &prediction([a, [0.0; 4], c]), [1.0; 4]);
        assert_eq!(found.observable[2], observable);
    }
}
