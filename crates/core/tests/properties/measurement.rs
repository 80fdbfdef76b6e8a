//! The most probable state of an image, against the closed form for a linear sensor.

use crate::estimation::kalman::Kalman;
use crate::estimation::measurement::{Observed, Prior, Sensor};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

use super::config;

/// DOFs, features and errors of the geometry; a state and an error of the geometry together.
const N: usize = 2;
const M: usize = 6;
const ALL: usize = N + 1;

type State = SVector<f64, N>;
type Joint = SMatrix<f64, ALL, ALL>;

/// Features H (q, g) in points of two.
struct Plane(SMatrix<f64, M, ALL>);

impl Sensor<N, M, 1> for Plane {
    fn point(&self) -> usize {
        2
    }

    fn features(&self, state: &[f64; N], geometry: &[f64; 1]) -> Option<([f64; M], [[f64; M]; N])> {
        let all = SVector::from([state[0], state[1], geometry[0]]);
        let column = |index| SVector::<f64, M>::from(self.0.column(index)).into();
        Some(((self.0 * all).into(), [column(0), column(1)]))
    }

    fn by_geometry(&self, _: &[f64; N], _: &[f64; 1]) -> Option<[[f64; M]; 1]> {
        Some([SVector::<f64, M>::from(self.0.column(2)).into()])
    }
}

/// A linear sensor, a prior as mean and covariance of state and geometry, and features of a true state and geometry.
#[derive(Debug, Clone)]
struct Problem {
    rows: SMatrix<f64, M, ALL>,
    mean: SVector<f64, ALL>,
    covariance: Joint,
    noise: SMatrix<f64, M, M>,
    features: SVector<f64, M>,
}

/// Positive definite, and correlated.
fn covariance<const C: usize>(root: &[[f64; C]; C], least: f64, size: f64) -> SMatrix<f64, C, C> {
    let root = SMatrix::<f64, C, C>::from(*root);
    (root * root.transpose() + SMatrix::identity() * least) * (size * size)
}

fn square<const C: usize>() -> impl Strategy<Value = [[f64; C]; C]> {
    prop::array::uniform::<_, C>(prop::array::uniform::<_, C>(-1.0..1.0_f64))
}

fn problems() -> impl Strategy<Value = Problem> {
    let three = || prop::array::uniform3(-1.0..1.0_f64);
    let rows = prop::array::uniform3(prop::array::uniform6(-2.0..2.0_f64));
    let error = prop::array::uniform6(-1.0..1.0_f64);
    (rows, three(), three(), error, square::<3>(), square::<6>()).prop_map(
        |(rows, mean, off, error, own, noise)| {
            let (rows, mean) = (SMatrix::from(rows), SVector::from(mean));
            let covariance = covariance(&own, 0.1, 1.0);
            let truth = mean + covariance.cholesky().unwrap().l() * SVector::from(off);
            Problem {
                rows,
                mean,
                covariance,
                noise: self::covariance(&noise, 0.1, 0.1),
                features: rows * truth + SVector::from(error) * 0.03,
            }
        },
    )
}

impl Problem {
    /// As the estimate gives it: the geometry by its slope over the state.
    fn prior(&self) -> Prior<N, 1> {
        let state = self.covariance.fixed_view::<N, N>(0, 0).into_owned();
        let cross = self.covariance.fixed_view::<1, N>(N, 0).into_owned();
        let slope = cross * state.try_inverse().unwrap();
        let geometry = self.covariance.fixed_view::<1, 1>(N, N).into_owned();
        Prior {
            state: self.mean.fixed_rows::<N>(0).into_owned(),
            covariance: state,
            geometry: self.mean.fixed_rows::<1>(N).into_owned(),
            slope,
            geometry_covariance: geometry - slope * cross.transpose(),
        }
    }

    fn observed(&self, seen: [bool; M]) -> Observed<M> {
        let mut features = self.features;
        for (value, seen) in features.iter_mut().zip(seen) {
            *value = if seen { *value } else { f64::NAN };
        }
        Observed {
            features,
            covariance: self.noise,
            seen,
        }
    }

    /// Mean and covariance of state and geometry after the used features, with the squared Mahalanobis distance of the
    /// innovation: that of the features without the others, whose variance is as good as infinite.
    fn posterior(&self, used: [bool; M]) -> (SVector<f64, ALL>, Joint, f64) {
        let chosen = SMatrix::<f64, M, M>::from_diagonal(&SVector::from(
            used.map(|used| f64::from(u8::from(used))),
        ));
        let rest = SMatrix::<f64, M, M>::identity() - chosen;
        let rows = chosen * self.rows;
        let total = rows * self.covariance * rows.transpose() + chosen * self.noise * chosen + rest;
        let inverse = total.try_inverse().unwrap();
        let innovation = chosen * self.features - rows * self.mean;
        let gain = self.covariance * rows.transpose() * inverse;
        (
            self.mean + gain * innovation,
            self.covariance - gain * rows * self.covariance,
            (innovation.transpose() * inverse * innovation)[0],
        )
    }
}

/// All of the points but those of which a bit is set.
fn without(points: u8) -> [bool; M] {
    core::array::from_fn(|index| points & (1 << (index / 2)) == 0)
}

const ALL_SEEN: [bool; M] = [true; M];

proptest! {
    #![proptest_config(config())]

    /// With features that are not seen, which are NaN.
    #[test]
    fn the_most_probable_state_is_the_mean_of_the_posterior(problem in problems(), hidden in 0..7_u8) {
        let seen = without(hidden);
        let found = problem.observed(seen);
        let found = found.most_probable(&Plane(problem.rows), &problem.prior(), core::iter::empty(), f64::INFINITY);
        let found = found.unwrap();
        let (mean, covariance, distance_squared) = problem.posterior(seen);
        prop_assert_eq!(found.used, seen);
        for dof in 0..N {
            prop_assert!((found.state[dof] - mean[dof]).abs() <= 1e-7, "{found:?} {mean}");
            prop_assert!((found.std[dof] - covariance[(dof, dof)].sqrt()).abs() <= 1e-7);
        }
        prop_assert!((found.distance_squared - distance_squared).abs() <= 1e-6 * (1.0 + distance_squared));
    }

    /// A Kalman filter that gets the independent measurements one by one ends in the posterior.
    #[test]
    fn the_linear_measurement_says_what_the_features_say(problem in problems(), hidden in 0..7_u8) {
        let seen = without(hidden);
        let (observed, prior) = (problem.observed(seen), problem.prior());
        let linear = observed.linearize(&Plane(problem.rows), &prior, seen, &[0.0; N]).unwrap();
        let root = problem.covariance.cholesky().unwrap().l();
        // Coefficients are what the root of the covariance multiplies: independent before the image.
        let mut kalman = Kalman::<ALL>::new(SVector::zeros(), SVector::repeat(1.0), ALL);
        for index in 0..M {
            let [a, b] = [0, 1].map(|dof| linear.by_state[(index, dof)]);
            let row = SVector::from([a, b, linear.by_geometry[(index, 0)]]);
            let value = linear.value[index] - row.dot(&problem.mean);
            let row = root.tr_mul(&row);
            let cross = kalman.covariance_with(0, row.as_slice());
            kalman.update(&row, &cross, &SVector::from([value]), 1.0, None);
        }
        let (mean, covariance, _) = problem.posterior(seen);
        prop_assert!((problem.mean + root * kalman.mean - mean).amax() <= 1e-6);
        let spread = Joint::from_fn(|a, b| kalman.covariance(a, b));
        prop_assert!((root * spread * root.transpose() - covariance).amax() <= 1e-6);
    }

    /// A state that deviates by `std` from what is estimated is noise of the features.
    #[test]
    fn a_deviation_of_the_state_is_noise(problem in problems(), std in prop::array::uniform2(0.0..1.0_f64)) {
        let (observed, prior) = (problem.observed(ALL_SEEN), problem.prior());
        let linear = observed.linearize(&Plane(problem.rows), &prior, ALL_SEEN, &std).unwrap();
        let by_state = problem.rows.fixed_columns::<N>(0);
        let spread = SMatrix::from_diagonal(&State::from(std.map(|std| std * std)));
        let noise = problem.noise + by_state * spread * by_state.transpose();
        // Whitened rows keep the information about the state.
        let information = linear.by_state.tr_mul(&linear.by_state);
        let expected = by_state.transpose() * noise.try_inverse().unwrap() * by_state;
        prop_assert!((information - expected).amax() <= 1e-6 * (1.0 + expected.amax()));
    }

    #[test]
    fn a_point_that_is_an_outlier_is_left_out(
        problem in problems(), point in 0..3_u8, side in prop_oneof![Just(-1.0), Just(1.0)],
    ) {
        let mut wrong = problem.clone();
        wrong.features[2 * usize::from(point)] += 1e3 * side;
        let used = without(1 << point);
        let price = 8.0;
        let (mean, _, rest) = wrong.posterior(used);
        prop_assume!(rest < price * price);
        // Three points less one leave enough to tell which.
        for other in (0..3).filter(|other| *other != point) {
            prop_assume!(wrong.posterior(without(1 << other)).2 > 2.0 * price * price);
        }
        let observed = wrong.observed(ALL_SEEN);
        let found = observed.most_probable(&Plane(wrong.rows), &wrong.prior(), core::iter::empty(), price).unwrap();
        prop_assert_eq!(found.used, used);
        prop_assert!((State::from(found.state) - mean.fixed_rows::<N>(0)).amax() <= 1e-6);
        prop_assert!((found.distance_squared - rest - price * price).abs() <= 1e-6 * price * price);
        let linear = observed.linearize(&Plane(wrong.rows), &wrong.prior(), used, &[0.1; N]).unwrap();
        for index in (0..M).filter(|index| !used[*index]) {
            prop_assert_eq!(linear.value[index], 0.0);
            prop_assert!(linear.by_state.row(index).iter().all(|entry| *entry == 0.0));
        }
    }
}

/// Two points, of which the first is almost the same in a mirrored state.
struct Mirror;

impl Sensor<N, 4, 0> for Mirror {
    fn point(&self) -> usize {
        2
    }

    fn features(&self, [q, p]: &[f64; N], _: &[f64; 0]) -> Option<([f64; 4], [[f64; 4]; N])> {
        let features = [q * q, 0.3 * q, *p, 0.5 * p];
        Some((features, [[2.0 * q, 0.3, 0.0, 0.0], [0.0, 0.0, 1.0, 0.5]]))
    }

    fn by_geometry(&self, _: &[f64; N], _: &[f64; 0]) -> Option<[[f64; 4]; 0]> {
        Some([])
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_mirrored_state_is_found_from_a_start_near_it(
        size in 0.8..1.2_f64, side in prop_oneof![Just(-1.0), Just(1.0)], p in -0.5..0.5_f64,
    ) {
        let truth = [side * size, p];
        let observed = Observed {
            features: SVector::from(Mirror.features(&truth, &[]).unwrap().0),
            covariance: SMatrix::from_diagonal_element(0.05 * 0.05),
            seen: [true; 4],
        };
        let prior = Prior::<N, 0> {
            state: SVector::from([-side, 0.0]),
            covariance: SMatrix::identity(),
            geometry: SVector::zeros(),
            slope: SMatrix::zeros(),
            geometry_covariance: SMatrix::zeros(),
        };
        let off = |starts: &[State], price| {
            let found = observed.most_probable(&Mirror, &prior, starts.iter().copied(), price).unwrap();
            (found.state[0] - truth[0]).abs()
        };
        let starts = [-2.0, 2.0].map(|start| State::from([start, 0.0]));
        prop_assert!(off(&starts, 5.0) <= 0.1);
        // Neither without a start there, nor where the first minimum is good enough.
        prop_assert!(off(&[], 1e3) >= size);
        prop_assert!(off(&starts, 1e3) >= size);
    }
}

#[test]
fn a_sensor_that_sees_nothing_measures_nothing() {
    struct Blind;
    impl Sensor<1, 1, 0> for Blind {
        fn point(&self) -> usize {
            1
        }
        fn features(&self, _: &[f64; 1], _: &[f64; 0]) -> Option<([f64; 1], [[f64; 1]; 1])> {
            None
        }
        fn by_geometry(&self, _: &[f64; 1], _: &[f64; 0]) -> Option<[[f64; 1]; 0]> {
            Some([])
        }
    }
    let observed = Observed {
        features: SVector::from([0.0]),
        covariance: SMatrix::identity(),
        seen: [true],
    };
    let prior = Prior::<1, 0> {
        state: SVector::zeros(),
        covariance: SMatrix::identity(),
        geometry: SVector::zeros(),
        slope: SMatrix::zeros(),
        geometry_covariance: SMatrix::zeros(),
    };
    assert!(
        observed
            .most_probable(&Blind, &prior, core::iter::empty(), f64::INFINITY)
            .is_none()
    );
}
