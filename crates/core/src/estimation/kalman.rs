//! Kalman filter of coefficients that return to their prior.

use nalgebra::{SMatrix, SVector};

/// Normally distributed coefficients.
///
/// Between measurements each returns to its prior with the travel (Ornstein-Uhlenbeck process), so that what the motion
/// does not excite has the prior's variance and no direction grows without bound. Updates are in Joseph's form, which keeps
/// the covariance positive for any gain (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977).
#[derive(Debug, Clone, PartialEq)]
pub struct Kalman<const D: usize> {
    prior_mean: SVector<f64, D>,
    prior_variance: SVector<f64, D>,
    mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> Kalman<D> {
    /// At the prior: means and variances (D,).
    pub fn new(mean: SVector<f64, D>, variance: SVector<f64, D>) -> Self {
        Self {
            prior_mean: mean,
            prior_variance: variance,
            mean,
            covariance: SMatrix::from_diagonal(&variance),
        }
    }

    /// Means (D,).
    pub const fn mean(&self) -> &SVector<f64, D> {
        &self.mean
    }

    /// Covariance of two coefficients.
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance
            .get((a.max(b), a.min(b)))
            .copied()
            .unwrap_or(f64::NAN)
    }

    /// Variance of a coefficient.
    pub fn variance(&self, index: usize) -> f64 {
        self.covariance(index, index)
    }

    /// Means (D,).
    pub const fn mean_mut(&mut self) -> &mut SVector<f64, D> {
        &mut self.mean
    }

    /// Covariance of all coefficients with row . x.
    pub fn covariance_with(&self, row: &SVector<f64, D>) -> SVector<f64, D> {
        let mut out = SVector::<f64, D>::zeros();
        out.sygemv(1.0, &self.covariance, row, 0.0);
        out
    }

    /// Adds an independent variance to a coefficient.
    pub fn add_variance(&mut self, index: usize, variance: f64) {
        if let Some(entry) = self.covariance.get_mut((index, index)) {
            *entry += variance;
        }
    }

    /// Return to the prior by the shares `keep` (D,) of what is kept:
    ///
    /// ```text
    /// x <- x0 + keep (x - x0),    P <- keep P keep + (1 - keep^2) P0
    /// ```
    pub fn decay(&mut self, keep: &SVector<f64, D>) {
        for (mean, (prior, keep)) in self.mean.iter_mut().zip(self.prior_mean.iter().zip(keep)) {
            *mean = prior + keep * (*mean - prior);
        }
        for (mut column, by) in self.covariance.column_iter_mut().zip(keep) {
            column.component_mul_assign(keep);
            column *= *by;
        }
        let noise = self
            .prior_variance
            .zip_map(keep, |prior, keep| (1.0 - keep * keep) * prior);
        for (index, variance) in noise.iter().enumerate() {
            self.add_variance(index, *variance);
        }
    }

    /// Update with row . x = value + noise of a variance; `weight` (D,) multiplies the gain of each coefficient.
    ///
    /// ```text
    /// s = h' P h + r,   k = weight P h / s,   x <- x + k (value - h' x),   P <- (I - k h') P (I - k h')' + r k k'
    /// ```
    pub fn update(
        &mut self,
        row: &SVector<f64, D>,
        value: f64,
        variance: f64,
        weight: Option<&SVector<f64, D>>,
    ) {
        let cross = self.covariance_with(row);
        let total = row.dot(&cross) + variance;
        let mut gain = cross / total;
        if let Some(weight) = weight {
            gain.component_mul_assign(weight);
        }
        let innovation = value - row.dot(&self.mean);
        self.mean.axpy(innovation, &gain, 1.0);
        let half = cross - gain * (0.5 * total);
        self.covariance.syger(-1.0, &gain, &half, 1.0);
        self.covariance.syger(-1.0, &half, &gain, 1.0);
    }
}
