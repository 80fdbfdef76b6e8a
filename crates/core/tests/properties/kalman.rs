//! The Kalman filter of coefficients, against formulas of whole matrices and against least squares.

use crate::estimation::kalman::Kalman;
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

use super::config;

const D: usize = 5;

type Vector = SVector<f64, D>;
type Matrix = SMatrix<f64, D, D>;

/// Row, value and variance of a measurement.
type Measurement = (Vector, f64, f64);

fn vectors(low: f64, high: f64) -> impl Strategy<Value = Vector> {
    prop::array::uniform::<_, D>(low..high).prop_map(Vector::from)
}

fn measurements() -> impl Strategy<Value = Vec<Measurement>> {
    let one = (vectors(-1.0, 1.0), -2.0..2.0_f64, 0.01..2.0_f64);
    prop::collection::vec(one, 1..12)
}

/// Means and covariance of a filter.
fn found(kalman: &Kalman<D>) -> (Vector, Matrix) {
    (
        *kalman.mean(),
        Matrix::from_fn(|a, b| kalman.covariance(a, b)),
    )
}

fn updated(mean: Vector, variance: Vector, measurements: &[Measurement]) -> Kalman<D> {
    let mut kalman = Kalman::new(mean, variance);
    for (row, value, variance) in measurements {
        kalman.update(row, *value, *variance, None);
    }
    kalman
}

fn check_alike(
    (mean, covariance): (Vector, Matrix),
    other: (Vector, Matrix),
) -> Result<(), TestCaseError> {
    let by_mean = (mean - other.0).amax();
    let by_covariance = (covariance - other.1).amax();
    prop_assert!(by_mean <= 1e-9, "{mean} {}", other.0);
    prop_assert!(by_covariance <= 1e-9, "{covariance} {}", other.1);
    Ok(())
}

proptest! {
    #![proptest_config(config())]

    /// Information matrix and vector are sums over the measurements and the prior.
    #[test]
    fn updates_are_least_squares(
        mean in vectors(-1.0, 1.0), variance in vectors(0.1, 2.0), all in measurements(),
    ) {
        let prior = Matrix::from_diagonal(&variance.map(f64::recip));
        let (mut information, mut sum) = (prior, prior * mean);
        for (row, value, variance) in &all {
            information += row * row.transpose() / *variance;
            sum += row * (*value / variance);
        }
        let covariance = information.try_inverse().unwrap();
        check_alike(found(&updated(mean, variance, &all)), (covariance * sum, covariance))?;
    }

    #[test]
    fn the_order_of_updates_does_not_matter(
        mean in vectors(-1.0, 1.0), variance in vectors(0.1, 2.0),
        (all, shuffled) in measurements().prop_flat_map(|all| (Just(all.clone()), Just(all).prop_shuffle())),
    ) {
        let (first, second) = (updated(mean, variance, &all), updated(mean, variance, &shuffled));
        check_alike(found(&first), found(&second))?;
    }

    /// Joseph's form, which is right for any gain.
    #[test]
    fn weighted_gains_are_josephs_form_and_a_weight_of_zero_changes_no_coefficient(
        mean in vectors(-1.0, 1.0), variance in vectors(0.1, 2.0), before in measurements(),
        (row, value, noise) in (vectors(-1.0, 1.0), -2.0..2.0_f64, 0.01..2.0_f64),
        weight in prop::array::uniform::<_, D>(prop_oneof![Just(0.0), Just(1.0), 0.0..1.0]),
    ) {
        let weight = Vector::from(weight);
        let mut kalman = updated(mean, variance, &before);
        let (x, p) = found(&kalman);
        kalman.update(&row, value, noise, Some(&weight));
        let total = (row.transpose() * p * row)[0] + noise;
        let gain = (p * row / total).component_mul(&weight);
        let kept = Matrix::identity() - gain * row.transpose();
        let expected = kept * p * kept.transpose() + gain * gain.transpose() * noise;
        check_alike(found(&kalman), (x + gain * (value - row.dot(&x)), expected))?;
        for index in (0..D).filter(|index| weight[*index] == 0.0) {
            prop_assert_eq!(kalman.mean()[index], x[index]);
            prop_assert_eq!(kalman.variance(index), p[(index, index)]);
        }
    }

    #[test]
    fn covariance_with_a_row_is_a_product(
        variance in vectors(0.1, 2.0), all in measurements(), row in vectors(-1.0, 1.0),
        index in 0..D, more in 0.0..2.0_f64,
    ) {
        let mut kalman = updated(Vector::zeros(), variance, &all);
        let (_, before) = found(&kalman);
        prop_assert!((kalman.covariance_with(&row) - before * row).amax() <= 1e-12);
        kalman.add_variance(index, more);
        let mut expected = before;
        expected[(index, index)] += more;
        prop_assert!((found(&kalman).1 - expected).amax() <= 1e-12);
    }

    /// A return in two parts is one, in the limit it is the prior, and the prior stays.
    #[test]
    fn coefficients_return_to_the_prior(
        mean in vectors(-1.0, 1.0), variance in vectors(0.1, 2.0), all in measurements(),
        first in vectors(0.0, 1.0), second in vectors(0.0, 1.0),
    ) {
        let start = updated(mean, variance, &all);
        let (x, p) = found(&start);
        let mut once = start.clone();
        once.decay(&first);
        let keep = Matrix::from_diagonal(&first);
        let noise = variance.zip_map(&first, |variance, keep| (1.0 - keep * keep) * variance);
        let expected = keep * p * keep + Matrix::from_diagonal(&noise);
        check_alike(found(&once), (mean + keep * (x - mean), expected))?;
        let mut twice = once.clone();
        twice.decay(&second);
        let mut whole = start.clone();
        whole.decay(&first.component_mul(&second));
        check_alike(found(&twice), found(&whole))?;
        for _ in 0..60 {
            twice.decay(&Vector::repeat(0.5));
        }
        let prior = (mean, Matrix::from_diagonal(&variance));
        check_alike(found(&twice), prior)?;
        let mut rested = Kalman::new(mean, variance);
        rested.decay(&first);
        check_alike(found(&rested), prior)?;
    }
}

/// Exact measurements in a few directions, then in others, with what is forgotten in between.
#[test]
fn the_covariance_stays_positive_definite() {
    let mut random = 2013_u64;
    let mut share = || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        f64::from(u32::try_from(random >> 32).unwrap()) / f64::from(u32::MAX)
    };
    let prior = Vector::from([1e-4, 1e-2, 1.0, 1e2, 1e4]);
    let mut kalman = Kalman::new(Vector::zeros(), prior);
    let keep = Vector::from([0.999, 0.9999, 0.99999, 1.0, 1.0]);
    let (mut row, mut weight) = (Vector::repeat(1.0), None);
    for count in 0..100_000 {
        if count % 100 == 0 {
            row = Vector::from_fn(|_, _| 2.0 * share() - 1.0);
            weight = (share() < 0.3).then(|| Vector::from_fn(|_, _| share().round()));
        }
        kalman.update(&row, share(), 1e-6, weight.as_ref());
        kalman.decay(&keep);
        if count % 500 == 499 {
            let (mean, covariance) = found(&kalman);
            assert!(mean.iter().all(|value| value.is_finite()));
            assert!(covariance.cholesky().is_some(), "{count}: {covariance}");
            assert!(
                (0..D).all(|index| covariance[(index, index)] <= prior[index] * (1.0 + 1e-6)),
                "{count}: {covariance}"
            );
        }
    }
}
