//! The estimate of profile `plays`: the tip as a linear combination of fixed plays, by one Kalman filter.

use nalgebra::{SMatrix, SVector};

use crate::error::{ConfigError, require_positive};
use crate::estimation::estimate_settings::EstimateSettings;
use crate::estimation::kalman::Kalman;
use crate::estimation::measurement::{Linear, Prior};
use crate::model::plays::{
    COEFFICIENTS, DEVIATION, OFFSET, OWN, Plays, Row, SHARED, Transmission, gain_row, middle_row,
    product,
};

/// Expected half width, and its spread, in units: of the Gaussian weights of the plays over their radii.
const EXPECTED: f64 = 2.0 / 3.0;
const SPREAD: f64 = 0.2;
/// Prior weight of an own play over that of a vector play.
const OWN_SHARE: f64 = 0.4;
/// Standard deviation of a bent play over that of a play.
const BENT_SHARE: f64 = 0.4;
/// Bounds of the gain: a tip that moves less than half or more than half as much again as its motor is another instrument.
const GAINS: (f64, f64) = (0.5, 1.5);
/// Distance from which on an image counts less, in standard deviations of a feature.
const ROBUST: f64 = 2.5;

/// Normally distributed coefficients of the plays of N DOFs, and G errors of the geometry: D = N `COEFFICIENTS` + G.
///
/// ```text
/// tip_i = origin_i + unit_i phi_i(c) . w_i         phi: regressors of Plays, which no image corrects
/// ```
///
/// Width, rounding, gain, asymmetry, slack over position and share of friction are all coefficients, and each image measures
/// tip and geometry linearly. What the plays leave of the tip is one coefficient, too, the deviation: it is alike within a
/// travel of `deviation_travel`, so that the images within it count as one for the plays.
///
/// Wrong for a tip that is no sum of plays: by what its deviation changes between images.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate<const N: usize, const G: usize, const D: usize> {
    transmission: Transmission<N>,
    settings: EstimateSettings,
    kalman: Kalman<D>,
    origin: [f64; N],
    /// Travel over which each error of the geometry returns to 0.
    memory: [f64; G],
    /// Travel of the command at the last image.
    travel: f64,
}

/// An error of the geometry before the first image: its standard deviation, and the travel over which it returns to 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometryPrior {
    /// Standard deviation.
    pub std: f64,
    /// Travel in units.
    pub travel: f64,
}

/// What is estimated of a DOF, in its unit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slack {
    /// Half of the width of the backlash.
    pub half_width: f64,
    /// Its standard deviation.
    pub half_width_std: f64,
    /// Centre of the contact offsets, command less tip over the gain, from the origin.
    pub centre: f64,
    /// Travel of the tip over that of the command in contact.
    pub gain: f64,
    /// Its standard deviation.
    pub gain_std: f64,
}

impl<const N: usize, const G: usize, const D: usize> Estimate<N, G, D> {
    /// Before the first image, for errors of the geometry of standard deviations (G,).
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        settings: EstimateSettings,
        transmission: Transmission<N>,
        geometry: [GeometryPrior; G],
        start: &[Slack; N],
        start_std: [f64; N],
    ) -> Result<Self, ConfigError> {
        const { assert!(D == N * COEFFICIENTS + G) };
        settings.check()?;
        let (mut mean, mut variance) = (SVector::<f64, D>::zeros(), SVector::<f64, D>::zeros());
        let radii = transmission.radii();
        let own = mean.as_mut_slice().chunks_exact_mut(COEFFICIENTS);
        let spread = variance.as_mut_slice().chunks_exact_mut(COEFFICIENTS);
        let dofs = radii
            .into_iter()
            .zip(transmission.is_alone())
            .zip(start)
            .zip(transmission.unit());
        for ((mean, variance), (((radii, is_alone), start), unit)) in own.zip(spread).zip(dofs) {
            let (row, spread) = prior(&settings, &radii, is_alone, start, unit);
            mean.copy_from_slice(&row);
            variance.copy_from_slice(&spread);
        }
        for (entry, own) in variance.iter_mut().skip(N * COEFFICIENTS).zip(geometry) {
            *entry = own.std * own.std;
        }
        let mut kalman = Kalman::new(mean, variance);
        for (index, (start, unit)) in start_std.into_iter().zip(transmission.unit()).enumerate() {
            require_positive("start_deviation", start)?;
            let start = start / unit;
            kalman.add_variance(index * COEFFICIENTS + DEVIATION, start * start);
        }
        Ok(Self {
            transmission,
            settings,
            kalman,
            origin: [f64::NAN; N],
            memory: geometry.map(|own| own.travel),
            travel: 0.0,
        })
    }

    /// Begins at the first reference (N,) [m or rad].
    pub const fn start(&mut self, origin: [f64; N]) {
        self.origin = origin;
    }

    /// The plays.
    pub const fn transmission(&self) -> &Transmission<N> {
        &self.transmission
    }

    /// First reference (N,) [m or rad]; NaN before it.
    pub const fn origin(&self) -> [f64; N] {
        self.origin
    }

    /// Means of the coefficients of each DOF.
    pub fn coefficients(&self) -> [Row; N] {
        let mut rows = [[0.0; COEFFICIENTS]; N];
        let all = self.kalman.mean().as_slice().chunks_exact(COEFFICIENTS);
        rows.iter_mut()
            .zip(all)
            .for_each(|(row, own)| row.copy_from_slice(own));
        rows
    }

    /// Tip (N,) [m or rad] that the plays give.
    pub fn tip(&self, plays: &Plays<N>) -> [f64; N] {
        let mut tip = self.origin;
        let parts = plays
            .regressors()
            .into_iter()
            .zip(self.coefficients())
            .zip(self.transmission.unit());
        for (tip, ((phi, row), unit)) in tip.iter_mut().zip(parts) {
            *tip += unit * product(&phi, &row);
        }
        tip
    }

    /// Errors of the geometry (G,) and their standard deviations.
    pub fn geometry(&self) -> ([f64; G], [f64; G]) {
        let (mut mean, mut std) = ([0.0; G], [0.0; G]);
        for (index, (mean, std)) in mean.iter_mut().zip(&mut std).enumerate() {
            let index = N * COEFFICIENTS + index;
            *mean = self.kalman.mean().get(index).copied().unwrap_or(0.0);
            *std = libm::sqrt(self.kalman.variance(index));
        }
        (mean, std)
    }

    /// Propagates the coefficients to a travel of the command.
    pub fn advance(&mut self, travel: f64) {
        let passed = (travel - self.travel).max(0.0);
        if passed == 0.0 {
            return;
        }
        self.travel = travel;
        let settings = &self.settings;
        let keep = |memory: f64| libm::exp(-passed / memory);
        let (weights, offset, deviation) = (
            keep(settings.weight_travel),
            keep(settings.offset_travel),
            keep(settings.deviation_travel),
        );
        let mut shares = SVector::<f64, D>::repeat(weights);
        for (index, share) in shares.iter_mut().enumerate().take(N * COEFFICIENTS) {
            match index % COEFFICIENTS {
                OFFSET => *share = offset,
                DEVIATION => *share = deviation,
                _ => {}
            }
        }
        for (share, memory) in shares.iter_mut().skip(N * COEFFICIENTS).zip(self.memory) {
            *share = keep(memory);
        }
        self.kalman.decay(&shares);
    }

    /// State and geometry at plays, after [`Estimate::advance`] to them.
    pub fn prior(&self, plays: &Plays<N>) -> Prior<N, G> {
        let rows = self.rows(plays);
        let (mut covariance, mut cross) =
            (SMatrix::<f64, N, N>::zeros(), SMatrix::<f64, G, N>::zeros());
        for (column, row) in rows.iter().enumerate() {
            let with = self.kalman.covariance_with(row);
            for (line, other) in rows.iter().enumerate() {
                set(&mut covariance, line, column, other.dot(&with));
            }
            for (line, value) in with.iter().skip(N * COEFFICIENTS).enumerate() {
                set(&mut cross, line, column, *value);
            }
        }
        for (index, std) in self.noise().into_iter().enumerate() {
            let value = covariance.get((index, index)).copied().unwrap_or(0.0);
            set(&mut covariance, index, index, value + std * std);
        }
        let mut geometry = SMatrix::<f64, G, G>::zeros();
        for line in 0..G {
            for column in 0..G {
                let value = self
                    .kalman
                    .covariance(N * COEFFICIENTS + line, N * COEFFICIENTS + column);
                set(&mut geometry, line, column, value);
            }
        }
        let slope = covariance.cholesky().map_or_else(SMatrix::zeros, |factor| {
            factor.solve(&cross.transpose()).transpose()
        });
        Prior {
            state: SVector::from(self.tip(plays)),
            covariance,
            geometry: SVector::from(self.geometry().0),
            slope,
            geometry_covariance: geometry - slope * cross.transpose(),
        }
    }

    /// Standard deviation of the tip that is new in each image (N,) [m or rad].
    pub fn noise(&self) -> [f64; N] {
        self.transmission
            .unit()
            .map(|unit| self.settings.tip_deviation * unit)
    }

    /// Updates the coefficients with a linear measurement at plays, at a Mahalanobis distance; with `is_position_only` the
    /// deviation alone.
    pub fn update<const M: usize>(
        &mut self,
        plays: &Plays<N>,
        measurement: &Linear<N, M, G>,
        distance: f64,
        is_position_only: bool,
    ) {
        let mut weight = SVector::<f64, D>::zeros();
        if is_position_only {
            let deviations = weight
                .iter_mut()
                .take(N * COEFFICIENTS)
                .skip(DEVIATION)
                .step_by(COEFFICIENTS);
            deviations.for_each(|entry| *entry = 1.0);
        }
        let weight = is_position_only.then_some(&weight);
        let rows = self.rows(plays);
        let origin = SVector::from(self.origin);
        #[expect(clippy::cast_precision_loss, reason = "a few features")]
        let variance = (distance / (ROBUST * libm::sqrt(M as f64))).max(1.0);
        for index in 0..M {
            let by_state = measurement.by_state.row(index);
            let mut row = SVector::<f64, D>::zeros();
            for (by, own) in by_state.iter().zip(&rows) {
                row.axpy(*by, own, 1.0);
            }
            let by_geometry = measurement.by_geometry.row(index);
            let geometry = row.iter_mut().skip(N * COEFFICIENTS);
            geometry
                .zip(by_geometry.iter())
                .for_each(|(entry, by)| *entry = *by);
            let known: f64 = by_state
                .iter()
                .zip(origin.iter())
                .map(|(by, origin)| by * origin)
                .sum();
            let value = measurement.value.get(index).copied().unwrap_or(0.0) - known;
            self.kalman.update(&row, value, variance, weight);
        }
        self.bound_gains();
    }

    /// Makes the deviation of every tip less certain by standard deviations (N,) [m or rad].
    pub fn loosen(&mut self, std: [f64; N]) {
        for (index, (std, unit)) in std.into_iter().zip(self.transmission.unit()).enumerate() {
            let std = std / unit;
            self.kalman
                .add_variance(index * COEFFICIENTS + DEVIATION, std * std);
        }
    }

    /// Slack of each DOF that moves alone.
    pub fn slack(&self) -> [Slack; N] {
        let mut found = [Slack::default(); N];
        let dofs = self
            .transmission
            .radii()
            .into_iter()
            .zip(self.coefficients())
            .zip(self.transmission.unit());
        for (index, (slack, ((radii, row), unit))) in found.iter_mut().zip(dofs).enumerate() {
            let by_gain = gain_row();
            let by_width = width_row(&radii);
            let (gain, width) = (product(&by_gain, &row), product(&by_width, &row));
            let gain_used = gain.clamp(GAINS.0, GAINS.1);
            let half = width / gain_used;
            let place = |row: Row| {
                let mut all = SVector::<f64, D>::zeros();
                all.iter_mut()
                    .skip(index * COEFFICIENTS)
                    .zip(row)
                    .for_each(|(a, b)| *a = b);
                all
            };
            let (gains, widths) = (place(by_gain), place(by_width));
            let by_half = (widths - gains * half) / gain_used;
            let deviation = |row: &SVector<f64, D>| {
                libm::sqrt(row.dot(&self.kalman.covariance_with(row)).max(0.0))
            };
            *slack = Slack {
                half_width: unit * half.max(0.0),
                half_width_std: unit * deviation(&by_half),
                centre: -unit * product(&middle_row(), &row) / gain_used,
                gain: gain_used,
                gain_std: deviation(&gains),
            };
        }
        found
    }

    /// Share of the deflection that vector plays make, of all DOFs that share a friction; 0 without such.
    pub fn shared(&self) -> f64 {
        let (mut shared, mut all) = (0.0, 0.0);
        let dofs = self
            .transmission
            .radii()
            .into_iter()
            .zip(self.coefficients());
        for ((radii, row), is_alone) in dofs.zip(self.transmission.is_alone()) {
            if !is_alone {
                let parts = radii
                    .into_iter()
                    .zip(row)
                    .map(|(radius, weight)| radius * weight);
                shared += parts.clone().take(SHARED).sum::<f64>();
                all += parts.sum::<f64>();
            }
        }
        (shared / all).clamp(0.0, 1.0)
    }

    /// Rows (D,) whose product with the coefficients is the tip of each DOF from the origin [m or rad].
    fn rows(&self, plays: &Plays<N>) -> [SVector<f64, D>; N] {
        let mut rows = [SVector::<f64, D>::zeros(); N];
        let parts = plays.regressors().into_iter().zip(self.transmission.unit());
        for (index, (row, (phi, unit))) in rows.iter_mut().zip(parts).enumerate() {
            let own = row.iter_mut().skip(index * COEFFICIENTS);
            own.zip(phi).for_each(|(entry, phi)| *entry = unit * phi);
        }
        rows
    }

    /// Moves the means to the nearest ones, in the metric of their covariance, whose gains are within [`GAINS`].
    fn bound_gains(&mut self) {
        for index in 0..N {
            let mut row = SVector::<f64, D>::zeros();
            row.iter_mut()
                .skip(index * COEFFICIENTS)
                .zip(gain_row())
                .for_each(|(a, b)| *a = b);
            let gain = row.dot(self.kalman.mean());
            let excess = gain - gain.clamp(GAINS.0, GAINS.1);
            if excess != 0.0 {
                let with = self.kalman.covariance_with(&row);
                let step = -excess / row.dot(&with);
                self.kalman.mean_mut().axpy(step, &with, 1.0);
            }
        }
    }
}

/// Coefficients whose sum is the half width times the gain: radius of each play, and of the bent ones with their mean slope.
fn width_row(radii: &[f64; SHARED + OWN]) -> Row {
    let mut row = gain_row();
    let bent = radii
        .iter()
        .skip(SHARED)
        .step_by(2)
        .flat_map(|radius| [*radius; 3]);
    row.iter_mut()
        .zip(radii.iter().copied().chain(bent))
        .for_each(|(entry, radius)| *entry *= radius);
    let [.., offset, rest] = &mut row;
    (*offset, *rest) = (0.0, 0.0);
    row
}

/// Mean and variance of the coefficients of a DOF before the first image.
fn prior(
    settings: &EstimateSettings,
    radii: &[f64; SHARED + OWN],
    is_alone: bool,
    start: &Slack,
    unit: f64,
) -> (Row, Row) {
    let (mut mean, mut variance) = ([0.0; COEFFICIENTS], [0.0; COEFFICIENTS]);
    let expected = if start.half_width > 0.0 {
        start.half_width / unit
    } else {
        EXPECTED
    };
    let own = settings.weight_deviation * settings.weight_deviation;
    let mut sum = 0.0;
    for (index, ((mean, variance), radius)) in
        mean.iter_mut().zip(&mut variance).zip(radii).enumerate()
    {
        let off = (radius - expected) / SPREAD;
        let share = if is_alone || index < SHARED {
            1.0
        } else {
            OWN_SHARE
        };
        *mean = share * libm::exp(-0.5 * off * off);
        *variance = own;
        sum += *mean;
    }
    for weight in &mut mean {
        *weight /= sum;
    }
    for variance in variance.iter_mut().skip(SHARED + OWN) {
        *variance = BENT_SHARE * BENT_SHARE * own;
    }
    let [.., centre, _] = &mut mean;
    *centre = -start.centre / unit;
    let [.., offset, deviation] = &mut variance;
    *offset = settings.offset_deviation * settings.offset_deviation;
    *deviation = settings.rest_deviation * settings.rest_deviation;
    (mean, variance)
}

fn set<const R: usize, const C: usize>(
    matrix: &mut SMatrix<f64, R, C>,
    row: usize,
    column: usize,
    value: f64,
) {
    if let Some(entry) = matrix.get_mut((row, column)) {
        *entry = value;
    }
}
