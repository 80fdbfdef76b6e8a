//! One robust most probable state for the features of an image, and their linear measurement about it.

use nalgebra::{Cholesky, Const, SMatrix, SVector};

/// Gauss-Newton steps at most, and halvings of each.
const STEPS: usize = 12;
const HALVINGS: usize = 6;
/// Gain of a step, and its share of what is left, at which the iteration ends: along what is hardly determined, further steps
/// move the state far for nothing.
const ENOUGH: f64 = 1e-3;

/// A sensor: what it measures of a state of N DOFs, M features, of which G errors of its geometry are estimated.
pub trait Sensor<const N: usize, const M: usize, const G: usize> {
    /// Features that are right or wrong together: 2 for the points of an image.
    fn point(&self) -> usize;

    /// Features h (M,) in a state (N,) with an error (G,) of the geometry, and dh/dq, a column (M,) for each DOF.
    ///
    /// None where they cannot be seen.
    fn features(&self, state: &[f64; N], geometry: &[f64; G]) -> Option<([f64; M], [[f64; M]; N])>;

    /// dh/dg, a column (M,) for each error of the geometry.
    fn by_geometry(&self, state: &[f64; N], geometry: &[f64; G]) -> Option<[[f64; M]; G]>;
}

/// State and geometry before an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior<const N: usize, const G: usize> {
    /// Mean (N,) of the state.
    pub state: SVector<f64, N>,
    /// Its covariance (N, N).
    pub covariance: SMatrix<f64, N, N>,
    /// Mean (G,) of the errors of the geometry.
    pub geometry: SVector<f64, G>,
    /// A: by how much they change with the state (G, N).
    pub slope: SMatrix<f64, G, N>,
    /// Their covariance (G, G), given the state.
    pub geometry_covariance: SMatrix<f64, G, G>,
}

impl<const N: usize, const G: usize> Prior<N, G> {
    /// A state (N,) that is known, and a geometry as configured.
    pub fn at(state: [f64; N]) -> Self {
        Self {
            state: state.into(),
            covariance: SMatrix::zeros(),
            geometry: SVector::zeros(),
            slope: SMatrix::zeros(),
            geometry_covariance: SMatrix::zeros(),
        }
    }
}

/// Features (M,) with their covariance (M, M); those that are not `seen` may be NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observed<const M: usize> {
    /// Features (M,).
    pub features: SVector<f64, M>,
    /// Covariance (M, M).
    pub covariance: SMatrix<f64, M, M>,
    /// Which features there are.
    pub seen: [bool; M],
}

/// The most probable state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MostProbable<const N: usize, const M: usize> {
    /// State (N,).
    pub state: [f64; N],
    /// Its standard deviations (N,).
    pub std: [f64; N],
    /// Squared Mahalanobis distance of the innovation: what is minimised.
    pub distance_squared: f64,
    /// Which features were used.
    pub used: [bool; M],
    /// Features (M,) in the state, with the geometry of the prior.
    pub predicted: [f64; M],
    /// dh/dq there.
    pub by_state: [[f64; M]; N],
}

/// Independent scalar measurements of standard deviation 1 that are linear in state and geometry:
/// `by_state` q + `by_geometry` g = value + noise. Rows of features that are not used are 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linear<const N: usize, const M: usize, const G: usize> {
    /// Derivative (M, N) by the state.
    pub by_state: SMatrix<f64, M, N>,
    /// Derivative (M, G) by the errors of the geometry.
    pub by_geometry: SMatrix<f64, M, G>,
    /// Values (M,).
    pub value: SVector<f64, M>,
}

impl<const M: usize> Observed<M> {
    /// The most probable state by Gauss-Newton steps, over starts and over points that are left out:
    ///
    /// ```text
    /// argmin_q  (q - q0)' P^-1 (q - q0) + (s - h(q, g0) - H_g A (q - q0))' (R + H_g G H_g')^-1 (...) + price^2 per point left out
    /// ```
    ///
    /// with the prior q0, P of the state, g0 + A (q - q0), G of the geometry given the state, and R of the features: where a
    /// wrong geometry explains an image as well as another state does, both take their share.
    ///
    /// `starts` are further states from which the minimum is sought where it costs more than a point left out: a curved tip has
    /// mirrored postures. None where the sensor sees nothing.
    pub fn most_probable<const N: usize, const G: usize, S: Sensor<N, M, G>>(
        &self,
        sensor: &S,
        prior: &Prior<N, G>,
        starts: impl Iterator<Item = SVector<f64, N>>,
        price: f64,
    ) -> Option<MostProbable<N, M>> {
        let all = Problem::about(self, sensor, prior)?;
        let problem = |used| Problem::new(self, sensor, prior, all.by_geometry, used);
        let price = price * price;
        let mut best = all.minimum(SVector::zeros())?;
        if best.distance_squared > price {
            for start in starts {
                if let Some(other) = all.minimum(start)
                    && other.distance_squared < best.distance_squared
                {
                    best = other;
                }
            }
        }
        if best.distance_squared > price {
            for first in (0..M).step_by(sensor.point()) {
                let mut used = self.seen;
                for used in used.iter_mut().skip(first).take(sensor.point()) {
                    *used = false;
                }
                if used == self.seen || used == [false; M] {
                    continue;
                }
                if let Some(mut other) = problem(used).and_then(|one| one.minimum(SVector::zeros()))
                {
                    other.distance_squared += price;
                    if other.distance_squared < best.distance_squared {
                        best = other;
                    }
                }
            }
        }
        Some(best)
    }

    /// Squared Mahalanobis distance of the innovation in the prior's state.
    pub fn distance_squared<const N: usize, const G: usize, S: Sensor<N, M, G>>(
        &self,
        sensor: &S,
        prior: &Prior<N, G>,
    ) -> Option<f64> {
        let here = SVector::zeros();
        let problem = Problem::about(self, sensor, prior)?;
        problem.cost(&here, &problem.at(&here)?.0)
    }

    /// The most probable errors (G,) of the geometry in the prior's state, to first order:
    ///
    /// ```text
    /// g = g0 + G H_g' (R + H_g G H_g')^-1 (s - h(q0, g0))
    /// ```
    pub fn geometry<const N: usize, const G: usize, S: Sensor<N, M, G>>(
        &self,
        sensor: &S,
        prior: &Prior<N, G>,
    ) -> Option<[f64; G]> {
        let here = SVector::zeros();
        let problem = Problem::about(self, sensor, prior)?;
        let misfit = problem.misfit(&here, &problem.at(&here)?.0)?;
        let by_geometry = problem.whitener.apply(problem.by_geometry)?;
        Some((prior.geometry + prior.geometry_covariance * by_geometry.tr_mul(&misfit)).into())
    }

    /// The measurement of the features that are `used` about the prior's state, of a state that deviates by `std` (N,) from
    /// what is estimated.
    ///
    /// About the most probable state its errors would be those of the image: the derivatives would be correlated with the
    /// noise, and where state and geometry are hardly told apart, the filter would become certain of directions that no image
    /// measured and drift along them (Huang, Mourikis, Roumeliotis, Int. J. Robotics Research 29, 2010).
    pub fn linearize<const N: usize, const G: usize, S: Sensor<N, M, G>>(
        &self,
        sensor: &S,
        prior: &Prior<N, G>,
        used: [bool; M],
        std: &[f64; N],
    ) -> Option<Linear<N, M, G>> {
        let (state, geometry) = (prior.state.into(), prior.geometry.into());
        let (predicted, by_state) = sensor.features(&state, &geometry)?;
        let by_state = SMatrix::<f64, M, N>::from(by_state);
        let by_geometry = SMatrix::<f64, M, G>::from(sensor.by_geometry(&state, &geometry)?);
        let mut spread = by_state;
        for (mut column, std) in spread.column_iter_mut().zip(std) {
            column *= *std;
        }
        let value = self.features - SVector::from(predicted)
            + by_state * prior.state
            + by_geometry * prior.geometry;
        let whitener = Whitener::new(self.covariance + spread * spread.transpose(), used)?;
        Some(Linear {
            by_state: whitener.apply(by_state)?,
            by_geometry: whitener.apply(by_geometry)?,
            value: whitener.apply(value)?,
        })
    }
}

/// L^-1 for the features that are used, where L L' is their covariance.
struct Whitener<const M: usize> {
    factor: Cholesky<f64, Const<M>>,
    used: [bool; M],
}

impl<const M: usize> Whitener<M> {
    fn new(mut covariance: SMatrix<f64, M, M>, used: [bool; M]) -> Option<Self> {
        for (index, _) in used.iter().enumerate().filter(|(_, used)| !**used) {
            covariance.column_mut(index).fill(0.0);
            covariance.row_mut(index).fill(0.0);
            *covariance.get_mut((index, index))? = 1.0;
        }
        Some(Self {
            factor: Cholesky::new(covariance)?,
            used,
        })
    }

    fn apply<const C: usize>(&self, mut columns: SMatrix<f64, M, C>) -> Option<SMatrix<f64, M, C>> {
        for (index, _) in self.used.iter().enumerate().filter(|(_, used)| !**used) {
            columns.row_mut(index).fill(0.0);
        }
        self.factor
            .l_dirty()
            .solve_lower_triangular_mut(&mut columns)
            .then_some(columns)
    }
}

/// The least squares of one choice of features; x is the state in standard deviations: q = q0 + factor x.
struct Problem<'a, const N: usize, const M: usize, const G: usize, S> {
    observed: &'a Observed<M>,
    sensor: &'a S,
    prior: &'a Prior<N, G>,
    factor: SMatrix<f64, N, N>,
    /// `H_g`
    by_geometry: SMatrix<f64, M, G>,
    /// `H_g A`: change of the features by the geometry that changes with the state.
    by_slope: SMatrix<f64, M, N>,
    used: [bool; M],
    whitener: Whitener<M>,
}

/// Features and dh/dq in a state.
type Features<const N: usize, const M: usize> = ([f64; M], [[f64; M]; N]);

impl<'a, const N: usize, const M: usize, const G: usize, S: Sensor<N, M, G>>
    Problem<'a, N, M, G, S>
{
    /// With all features that are seen.
    fn about(observed: &'a Observed<M>, sensor: &'a S, prior: &'a Prior<N, G>) -> Option<Self> {
        let (state, geometry) = (prior.state.into(), prior.geometry.into());
        let by_geometry = SMatrix::from(sensor.by_geometry(&state, &geometry)?);
        Self::new(observed, sensor, prior, by_geometry, observed.seen)
    }

    fn new(
        observed: &'a Observed<M>,
        sensor: &'a S,
        prior: &'a Prior<N, G>,
        by_geometry: SMatrix<f64, M, G>,
        used: [bool; M],
    ) -> Option<Self> {
        let covariance =
            observed.covariance + by_geometry * prior.geometry_covariance * by_geometry.transpose();
        Some(Self {
            observed,
            sensor,
            prior,
            factor: Cholesky::new(prior.covariance)?.l(),
            by_geometry,
            by_slope: by_geometry * prior.slope,
            used,
            whitener: Whitener::new(covariance, used)?,
        })
    }

    fn at(&self, x: &SVector<f64, N>) -> Option<Features<N, M>> {
        let state = self.prior.state + self.factor * x;
        self.sensor
            .features(&state.into(), &self.prior.geometry.into())
    }

    fn misfit(&self, x: &SVector<f64, N>, features: &[f64; M]) -> Option<SVector<f64, M>> {
        let moved = self.by_slope * (self.factor * x);
        self.whitener
            .apply(self.observed.features - SVector::from(*features) - moved)
    }

    fn cost(&self, x: &SVector<f64, N>, features: &[f64; M]) -> Option<f64> {
        let cost = x.norm_squared() + self.misfit(x, features)?.norm_squared();
        cost.is_finite().then_some(cost)
    }

    fn minimum(&self, start: SVector<f64, N>) -> Option<MostProbable<N, M>> {
        let mut x = start;
        let mut here = self.at(&x)?;
        let mut cost = self.cost(&x, &here.0)?;
        let mut normal = self.normal(&x, &here)?;
        for _ in 0..STEPS {
            let step = normal.0.solve(&normal.1);
            let mut share = 1.0;
            let better = (0..HALVINGS).find_map(|_| {
                let trial = x + step * share;
                share /= 2.0;
                let there = self.at(&trial)?;
                let less = self.cost(&trial, &there.0)?;
                (less <= cost).then_some((trial, there, less))
            });
            let Some((there, seen, less)) = better else {
                break;
            };
            let is_enough = cost - less < ENOUGH.max(ENOUGH * less);
            (x, here, cost) = (there, seen, less);
            normal = self.normal(&x, &here)?;
            if is_enough {
                break;
            }
        }
        let spread = self.factor * normal.0.inverse() * self.factor.transpose();
        Some(MostProbable {
            state: (self.prior.state + self.factor * x).into(),
            std: spread.diagonal().map(libm::sqrt).into(),
            distance_squared: cost,
            used: self.used,
            predicted: here.0,
            by_state: here.1,
        })
    }

    /// Factor of the normal matrix, and right side of the Gauss-Newton step.
    fn normal(
        &self,
        x: &SVector<f64, N>,
        (features, by_state): &Features<N, M>,
    ) -> Option<(Cholesky<f64, Const<N>>, SVector<f64, N>)> {
        let by_state = SMatrix::from(*by_state) + self.by_slope;
        let rows = self.whitener.apply(by_state * self.factor)?;
        let right = rows.tr_mul(&self.misfit(x, features)?) - x;
        Some((
            Cholesky::new(SMatrix::identity() + rows.tr_mul(&rows))?,
            right,
        ))
    }
}
