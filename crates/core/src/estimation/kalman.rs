//! Kalman filter of coefficients that return to their prior.

use nalgebra::{DVectorView, SMatrix, SVector};

/// Normally distributed coefficients.
///
/// Between measurements each returns to its prior with the travel (Ornstein-Uhlenbeck process), so that what the motion
/// does not excite has the prior's variance and no direction grows without bound. Updates are in Joseph's form, which keeps
/// the covariance positive for any gain (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977).
#[derive(Debug, Clone, PartialEq)]
pub struct Kalman<const D: usize> {
    prior_mean: SVector<f64, D>,
    /// The prior's covariance is diag(v) - t t' within each block of coefficients, and 0 between blocks: of independent
    /// coefficients of variances v, of each block a weighted sum is known as well.
    variance: SVector<f64, D>,
    tie: SVector<f64, D>,
    block: usize,
    /// Means (D,).
    pub mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> Kalman<D> {
    /// At the prior: means and variances (D,) of coefficients in blocks of `block`.
    pub fn new(mean: SVector<f64, D>, variance: SVector<f64, D>, block: usize) -> Self {
        Self {
            prior_mean: mean,
            variance,
            tie: SVector::zeros(),
            block,
            mean,
            covariance: SMatrix::from_diagonal(&variance),
        }
    }

    /// Makes the prior of row . x as certain as `std`, where `row` (D,) is of one block, of which no other sum is known yet.
    pub fn know_sum(&mut self, row: &SVector<f64, D>, std: f64) {
        let cross = row.component_mul(&self.variance);
        let total = row.dot(&cross);
        let known = 1.0 - (std * std / total).min(1.0);
        let tie = cross * libm::sqrt(known / total);
        self.tie += tie;
        self.covariance.syger(-1.0, &tie, &tie, 1.0);
    }

    /// Covariance of two coefficients.
    pub fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance
            .get((a.max(b), a.min(b)))
            .copied()
            .unwrap_or(f64::NAN)
    }

    /// Covariance of all coefficients with row . x, for a row of the coefficients from `first` on.
    pub fn covariance_with(&self, first: usize, row: &[f64]) -> SVector<f64, D> {
        let row = DVectorView::from_slice(row, row.len());
        let (width, end) = (row.len(), first + row.len());
        let mut out = SVector::<f64, D>::zeros();
        // Only the lower triangle is kept.
        let left = self.covariance.view((first, 0), (width, first));
        out.rows_mut(0, first).gemv_tr(1.0, &left, &row, 0.0);
        let own = self.covariance.view((first, first), (width, width));
        out.rows_mut(first, width).sygemv(1.0, &own, &row, 0.0);
        let below = self.covariance.view((end, first), (D - end, width));
        out.rows_mut(end, D - end).gemv(1.0, &below, &row, 0.0);
        out
    }

    /// Covariance of the coefficients of 1 in `only` (D,) with rows (D, M) of these alone; 0 for the others.
    fn cross_of<const M: usize>(
        &self,
        only: &SVector<f64, D>,
        rows: &SMatrix<f64, D, M>,
    ) -> SMatrix<f64, D, M> {
        let own = |index: usize| only.get(index).is_some_and(|own| *own != 0.0);
        let mut cross = SMatrix::<f64, D, M>::zeros();
        for a in (0..D).filter(|a| own(*a)) {
            for b in (0..D).filter(|b| own(*b)) {
                let part = rows.row(b) * self.covariance(a, b);
                let mut entries = cross.row_mut(a);
                entries += part;
            }
        }
        cross
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
    /// x <- x0 + keep (x - x0),    P <- keep (P - P0) keep + P0
    /// ```
    pub fn decay(&mut self, keep: &SVector<f64, D>) {
        for (mean, (prior, keep)) in self.mean.iter_mut().zip(self.prior_mean.iter().zip(keep)) {
            *mean = prior + keep * (*mean - prior);
        }
        let columns = self.covariance.as_mut_slice().chunks_exact_mut(D);
        for (index, (column, by)) in columns.zip(keep).enumerate() {
            let below = column.iter_mut().zip(keep.as_slice()).skip(index);
            below.for_each(|(entry, keep)| *entry *= keep * by);
        }
        let (tie, block) = (self.tie, self.block);
        let noise = self
            .variance
            .zip_map(keep, |prior, keep| (1.0 - keep * keep) * prior);
        for (index, variance) in noise.iter().enumerate() {
            self.add_variance(index, *variance);
        }
        for column in 0..D {
            let by = |values: &SVector<f64, D>| values.get(column).copied().unwrap_or(0.0);
            let (known, kept) = (by(&tie), by(keep));
            let end = D.min((column / block + 1) * block);
            let mut rows = self.covariance.view_range_mut(column..end, column);
            let others = tie.rows_range(column..end);
            for (entry, (other, keep)) in rows
                .iter_mut()
                .zip(others.iter().zip(keep.rows_range(column..end).iter()))
            {
                *entry -= (1.0 - kept * keep) * known * other;
            }
        }
    }

    /// Update with M measurements row . x = value of independent noise of a variance each.
    ///
    /// ```text
    /// C = P H',  S = H C + r I,  K = C S^-1,  x <- x + K (value - H x),  P <- (I - K H) P (I - K H)' + r K K'
    /// ```
    ///
    /// `rows` are H' (D, M) and `cross` is C. With `only` (D,) of 0 and 1, K is that of a filter that knows all coefficients
    /// but those of 1, so that a correlation with the others turns no step around. No update where S is not positive.
    pub fn update<const M: usize>(
        &mut self,
        rows: &SMatrix<f64, D, M>,
        cross: &SMatrix<f64, D, M>,
        value: &SVector<f64, M>,
        variance: f64,
        only: Option<&SVector<f64, D>>,
    ) {
        let noise = SMatrix::<f64, M, M>::identity() * variance;
        let own = only.map_or(*cross, |only| self.cross_of(only, rows));
        let Some(factor) = (rows.tr_mul(&own) + noise).cholesky() else {
            return;
        };
        let gain = own * factor.inverse();
        let total = rows.tr_mul(cross) + noise;
        let innovation = value - rows.tr_mul(&self.mean);
        self.mean += gain * innovation;
        let half = cross - gain * total * 0.5;
        let pairs = || {
            let gains = gain.as_slice().chunks_exact(D);
            gains.zip(half.as_slice().chunks_exact(D))
        };
        let columns = self.covariance.as_mut_slice().chunks_exact_mut(D);
        for (index, column) in columns.enumerate() {
            let below = column.get_mut(index..).unwrap_or_default();
            for (gain, half) in pairs() {
                let parts = (gain.get(index..), half.get(index..));
                if let (Some(gain @ [g, ..]), Some(half @ [h, ..])) = parts {
                    let parts = gain.iter().zip(half);
                    for (entry, (gain, half)) in below.iter_mut().zip(parts) {
                        *entry -= g * half + h * gain;
                    }
                }
            }
        }
    }
}
