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
    (kalman.mean, Matrix::from_fn(|a, b| kalman.covariance(a, b)))
}

/// An update with one measurement.
fn update(kalman: &mut Kalman<D>, row: &Vector, value: f64, variance: f64, only: Option<&Vector>) {
    let cross = kalman.covariance_with(0, row.as_slice());
    kalman.update(row, &cross, &SVector::from([value]), variance, only);
}

fn updated(mean: Vector, variance: Vector, measurements: &[Measurement]) -> Kalman<D> {
    let mut kalman = Kalman::new(mean, variance, D);
    for (row, value, variance) in measurements {
        update(&mut kalman, row, *value, *variance, None);
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

    /// Joseph's form, which is right for any gain, with that of a filter of some coefficients alone.
    #[test]
    fn an_update_of_some_coefficients_changes_no_other(
        mean in vectors(-1.0, 1.0), variance in vectors(0.1, 2.0), before in measurements(),
        (row, value, noise) in (vectors(-1.0, 1.0), -2.0..2.0_f64, 0.01..2.0_f64),
        only in prop::array::uniform::<_, D>(prop_oneof![Just(0.0), Just(1.0)]),
    ) {
        let only = Vector::from(only);
        let mut kalman = updated(mean, variance, &before);
        let (x, p) = found(&kalman);
        update(&mut kalman, &row, value, noise, Some(&only));
        let chosen = Matrix::from_diagonal(&only);
        let cross = chosen * p * chosen * row;
        let gain = cross / (row.dot(&cross) + noise);
        let kept = Matrix::identity() - gain * row.transpose();
        let expected = kept * p * kept.transpose() + gain * gain.transpose() * noise;
        check_alike(found(&kalman), (x + gain * (value - row.dot(&x)), expected))?;
        for index in (0..D).filter(|index| only[*index] == 0.0) {
            prop_assert_eq!(kalman.mean[index], x[index]);
            prop_assert_eq!(kalman.covariance(index, index), p[(index, index)]);
        }
    }

    #[test]
    fn covariance_with_a_row_is_a_product(
        variance in vectors(0.1, 2.0), all in measurements(), row in vectors(-1.0, 1.0),
        index in 0..D, first in 0..D, more in 0.0..2.0_f64,
    ) {
        let mut kalman = updated(Vector::zeros(), variance, &all);
        let (_, before) = found(&kalman);
        for end in first..=D {
            let own = Vector::from_fn(|index, _| if (first..end).contains(&index) { row[index] } else { 0.0 });
            let with = kalman.covariance_with(first, &own.as_slice()[first..end]);
            prop_assert!((with - before * own).amax() <= 1e-12);
        }
        kalman.add_variance(index, more);
        let mut expected = before;
        expected[(index, index)] += more;
        prop_assert!((found(&kalman).1 - expected).amax() <= 1e-12);
    }

    /// Two measurements together are the same as one after the other.
    #[test]
    fn measurements_may_come_together(
        mean in vectors(-1.0, 1.0), variance in vectors(0.1, 2.0),
        (first, second) in (vectors(-1.0, 1.0), vectors(-1.0, 1.0)), values in prop::array::uniform2(-2.0..2.0_f64),
        noise in 0.01..2.0_f64,
    ) {
        let [a, b] = values;
        let apart = updated(mean, variance, &[(first, a, noise), (second, b, noise)]);
        let mut together = Kalman::new(mean, variance, D);
        let rows = SMatrix::from_columns(&[first, second]);
        let cross = SMatrix::from_columns(&[first, second].map(|row| together.covariance_with(0, row.as_slice())));
        together.update(&rows, &cross, &SVector::from(values), noise, None);
        check_alike(found(&together), found(&apart))?;
    }

    /// A sum that is known is as certain as it is said to be, as after a measurement of it, and stays so.
    #[test]
    fn a_known_sum_is_part_of_the_prior(
        mean in vectors(-1.0, 1.0), variance in vectors(0.1, 2.0), row in vectors(0.2, 1.0), share in 0.1..1.0_f64,
        keep in 0.0..1.0_f64,
    ) {
        let mut kalman = Kalman::new(mean, variance, D);
        let total = row.dot(&row.component_mul(&variance));
        let std = share * total.sqrt();
        kalman.know_sum(&row, std);
        let prior = found(&kalman);
        prop_assert!(((row.transpose() * prior.1 * row)[0] - std * std).abs() <= 1e-9);
        let measured = updated(mean, variance, &[(row, row.dot(&mean), std * std * total / (total - std * std).max(1e-12))]);
        if share < 0.99 {
            check_alike(prior, found(&measured))?;
        }
        kalman.decay(&Vector::repeat(keep));
        check_alike(found(&kalman), prior)?;
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
        let mut rested = Kalman::new(mean, variance, D);
        rested.decay(&first);
        check_alike(found(&rested), prior)?;
    }
}

/// Exact measurements in a few directions, then in others, with what is forgotten in between.
fn check_positive_definite(part: f64) {
    let mut random = 2013_u64;
    let mut share = || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        f64::from(u32::try_from(random >> 32).unwrap()) / f64::from(u32::MAX)
    };
    let prior = Vector::from([1e-4, 1e-2, 1.0, 1e2, 1e4]);
    let mut kalman = Kalman::new(Vector::zeros(), prior, D);
    let keep = Vector::from([0.999, 0.9999, 0.99999, 1.0, 1.0]);
    let (mut row, mut only) = (Vector::repeat(1.0), None);
    for count in 0..100_000 {
        if count % 100 == 0 {
            row = Vector::from_fn(|_, _| 2.0 * share() - 1.0);
            only = (share() < part).then(|| Vector::from_fn(|_, _| share().round()));
        }
        update(&mut kalman, &row, share(), 1e-6, only.as_ref());
        kalman.decay(&keep);
        if count % 500 == 499 {
            let (mean, covariance) = found(&kalman);
            assert!(mean.iter().all(|value| value.is_finite()));
            assert!(covariance.cholesky().is_some(), "{count}: {covariance}");
            // Where some coefficients alone are updated, correlations with the others are lost.
            assert!(
                part > 0.0
                    || (0..D)
                        .all(|index| covariance[(index, index)] <= prior[index] * (1.0 + 1e-6)),
                "{count}: {covariance}"
            );
        }
    }
}

#[test]
fn the_covariance_stays_positive_definite() {
    check_positive_definite(0.0);
    check_positive_definite(0.3);
}
