//! The estimate of profile `best`: the tip as a linear combination of fixed plays, by one Kalman filter.

use nalgebra::{SMatrix, SVector};

use crate::dof::zip_with;
use crate::error::{ConfigError, require_positive};
use crate::estimation::estimate_settings::EstimateSettings;
use crate::estimation::kalman::Kalman;
use crate::estimation::measurement::{Linear, Prior};
use crate::math::linear::square;
use crate::model::plays::{
    COEFFICIENTS, GAIN_ROW, OFFSET, OWN, Plays, Radii, Row, SHARED, Transmission, product,
};
use crate::model::slack::{GAINS, Slack};

/// Expected half width, and its spread, in units: of the Gaussian weights of the plays over their radii.
const EXPECTED: f64 = 2.0 / 3.0;
const SPREAD: f64 = 0.2;
/// Prior weight of an own play over that of a vector play.
const OWN_SHARE: f64 = 0.4;
/// Standard deviation of a bent play over that of a play.
const BENT_SHARE: f64 = 0.4;
/// Standard deviation of the gain: the tip follows its motor about one to one.
const GAIN_DEVIATION: f64 = 0.3;
/// Images over which Birge's ratio is averaged.
const RECENT: f64 = 8.0;
/// Travel in units between two images from which on their errors are independent: images of a still scene err alike.
const STILL: f64 = 0.02;
/// Travel of the command of a DOF in units from which on its plays no longer depend on where in the slack the motion began.
const START: f64 = 1.5;
/// Least share of its information that an image has.
const LEAST: f64 = 0.001;

/// Normally distributed coefficients of the plays of N DOFs, and G errors of the geometry: D = N `COEFFICIENTS` + G.
///
/// ```text
/// tip_i = origin_i + unit_i phi_i(c) . w_i         phi: regressors of Plays, which no image corrects
/// ```
///
/// Width, rounding, gain, asymmetry, slack over position and share of friction are all coefficients, and each image measures
/// tip and geometry linearly.
///
/// Wrong for a tip that is no sum of plays: by what it deviates from one beyond `tip_deviation`.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate<const N: usize, const G: usize, const D: usize> {
    /// The plays.
    pub transmission: Transmission<N>,
    settings: EstimateSettings,
    kalman: Kalman<D>,
    /// First reference (N,) [m or rad]; NaN before it.
    pub origin: [f64; N],
    /// Travel over which each error of the geometry returns to 0.
    memory: [f64; G],
    /// Travel of the command at the last image.
    travel: f64,
    /// Travel since the last update.
    moved: f64,
    /// The beginning of the motion of each DOF.
    start: [Start; N],
    /// Mean of Birge's ratio over the last images, 1 or above: how much less they fit than expected.
    pub ratio: f64,
}

/// An error of the geometry before the first image: its standard deviation, and the travel over which it returns to 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometryPrior {
    /// Standard deviation.
    pub std: f64,
    /// Travel in units.
    pub travel: f64,
}

/// The beginning of the motion of a DOF, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Start {
    /// Standard deviation of the tip.
    std: f64,
    /// Travel after which the plays are known.
    left: f64,
    /// Command at the last measurement.
    command: f64,
}

/// Standard deviations of the slack of a DOF, in its unit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SlackDeviation {
    /// Of the half width.
    pub half_width: f64,
    /// Of the gain.
    pub gain: f64,
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
        let own = mean.as_mut_slice().chunks_exact_mut(COEFFICIENTS);
        let spread = variance.as_mut_slice().chunks_exact_mut(COEFFICIENTS);
        let dofs = transmission.dofs().iter().zip(start);
        for ((mean, variance), (dof, start)) in own.zip(spread).zip(dofs) {
            let (row, spread) = prior(&settings, dof, start);
            mean.copy_from_slice(&row);
            variance.copy_from_slice(&spread);
        }
        for (entry, own) in variance.iter_mut().skip(N * COEFFICIENTS).zip(geometry) {
            *entry = own.std * own.std;
        }
        let mut kalman = Kalman::new(mean, variance, COEFFICIENTS);
        for index in 0..N {
            kalman.know_sum(&of_dof(index, &GAIN_ROW), GAIN_DEVIATION);
        }
        for start in start_std {
            require_positive("start_deviation", start)?;
        }
        let start = zip_with(start_std, transmission.unit(), |start, unit| start / unit);
        let start = start.map(|std| Start {
            std,
            left: if G == 0 { START } else { 0.0 },
            command: 0.0,
        });
        for (index, start) in start.iter().enumerate() {
            kalman.add_variance(index * COEFFICIENTS + OFFSET, start.std * start.std);
        }
        Ok(Self {
            transmission,
            settings,
            kalman,
            origin: [f64::NAN; N],
            memory: geometry.map(|own| own.travel),
            travel: 0.0,
            moved: STILL,
            start,
            ratio: 1.0,
        })
    }

    /// Means of the coefficients of each DOF.
    pub fn coefficients(&self) -> [Row; N] {
        let mut rows = [[0.0; COEFFICIENTS]; N];
        let all = self.kalman.mean.as_slice().chunks_exact(COEFFICIENTS);
        rows.iter_mut()
            .zip(all)
            .for_each(|(row, own)| row.copy_from_slice(own));
        rows
    }

    /// Tip (N,) [m or rad] that the plays give.
    pub fn tip(&self, plays: &Plays<N>) -> [f64; N] {
        let apart = plays.tip(&self.coefficients());
        let moved = zip_with(apart, self.transmission.unit(), |tip, unit| unit * tip);
        zip_with(self.origin, moved, |origin, tip| origin + tip)
    }

    /// Errors of the geometry (G,) and their standard deviations.
    pub fn geometry(&self) -> ([f64; G], [f64; G]) {
        let (mut mean, mut std) = ([0.0; G], [0.0; G]);
        for (index, (mean, std)) in mean.iter_mut().zip(&mut std).enumerate() {
            let index = N * COEFFICIENTS + index;
            *mean = self.kalman.mean.get(index).copied().unwrap_or(0.0);
            *std = libm::sqrt(self.kalman.covariance(index, index));
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
        self.moved += passed;
        let settings = &self.settings;
        let keep = |memory: f64| libm::exp(-passed / memory);
        let mut shares = SVector::<f64, D>::repeat(keep(settings.weight_travel));
        let offset = keep(settings.offset_travel);
        for share in offsets::<N, D>(&mut shares) {
            *share = offset;
        }
        for (share, memory) in shares.iter_mut().skip(N * COEFFICIENTS).zip(self.memory) {
            *share = keep(memory);
        }
        self.kalman.decay(&shares);
    }

    /// State and geometry at plays, after [`Estimate::advance`] to them.
    pub fn prior(&self, plays: &Plays<N>) -> Prior<N, G> {
        let rows = self.rows(plays);
        let with = self.crosses(&rows);
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        for (mut column, with) in covariance.column_iter_mut().zip(with.column_iter()) {
            for (line, (entry, row)) in column.iter_mut().zip(&rows).enumerate() {
                *entry = product_at(line * COEFFICIENTS, row, with.as_slice());
            }
        }
        for (index, std) in self.noise().into_iter().enumerate() {
            if let Some(entry) = covariance.get_mut((index, index)) {
                *entry += std * std;
            }
        }
        let first = N * COEFFICIENTS;
        let cross: SMatrix<f64, G, N> = with.fixed_rows::<G>(first).into_owned();
        let geometry = SMatrix::<f64, G, G>::from_fn(|line, column| {
            self.kalman.covariance(first + line, first + column)
        });
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

    /// Updates the coefficients with a linear measurement at plays; with `is_position_only` the offsets alone.
    ///
    /// A measurement whose squared Mahalanobis `distance` is above the M that are expected has a variance larger by as much
    /// (Birge's ratio). So has one of a scene that has hardly moved since the last update. Where no geometry is estimated, it
    /// updates the offset of a DOF alone until this has moved by `START`; then the offset is as uncertain as before.
    pub fn update<const M: usize>(
        &mut self,
        plays: &Plays<N>,
        measurement: &Linear<N, M, G>,
        distance: f64,
        is_position_only: bool,
    ) {
        let mut only = SVector::<f64, D>::zeros();
        if is_position_only {
            offsets::<N, D>(&mut only).for_each(|entry| *entry = 1.0);
        }
        let only = is_position_only.then_some(&only);
        let mut regressors = self.rows(plays);
        let known = self.hold_weights_at_start(plays, &mut regressors);
        let (mut rows, mut cross) = (
            SMatrix::<f64, D, M>::zeros(),
            self.crosses(&regressors) * measurement.by_state.transpose(),
        );
        for (mut row, by) in rows.column_iter_mut().zip(measurement.by_state.row_iter()) {
            let blocks = row.as_mut_slice().chunks_exact_mut(COEFFICIENTS);
            for (entries, (own, by)) in blocks.zip(regressors.iter().zip(by.iter())) {
                entries.iter_mut().zip(own).for_each(|(a, b)| *a = by * b);
            }
        }
        for (index, by) in measurement.by_geometry.column_iter().enumerate() {
            let index = N * COEFFICIENTS + index;
            rows.row_mut(index).tr_copy_from(&by);
            let with = SVector::<f64, D>::from_fn(|other, _| self.kalman.covariance(other, index));
            cross.ger(1.0, &with, &by, 1.0);
        }
        #[expect(clippy::cast_precision_loss, reason = "a few features")]
        let variance = (distance * distance / M as f64).max(1.0);
        self.ratio += (variance - self.ratio) / RECENT;
        let variance = variance / (self.moved / STILL).clamp(LEAST, 1.0);
        self.moved = 0.0;
        let known = zip_with(self.origin, known, |origin, known| origin + known);
        let value = measurement.value - measurement.by_state * SVector::from(known);
        self.kalman.update(&rows, &cross, &value, variance, only);
        self.bound_gains();
    }

    /// A tip (N,) [m or rad] without the DOFs of which it is not known where in the slack they began.
    pub fn after_start(&self, tip: [f64; N]) -> [f64; N] {
        let left = self.start.each_ref().map(|start| start.left);
        zip_with(
            tip,
            left,
            |tip, left| if left > 0.0 { f64::NAN } else { tip },
        )
    }

    /// Makes the offset of every tip less certain by standard deviations (N,), at most up to others (N,) [m or rad].
    pub fn loosen(&mut self, std: [f64; N], most: [f64; N]) {
        let dofs = std.into_iter().zip(most).zip(self.transmission.unit());
        for (index, ((std, most), unit)) in dofs.enumerate() {
            let offset = index * COEFFICIENTS + OFFSET;
            let left = square(most / unit) - self.kalman.covariance(offset, offset);
            let variance = square(std / unit).min(left.max(0.0));
            self.kalman.add_variance(offset, variance);
        }
    }

    /// Slack of each DOF that moves alone.
    pub fn slack(&self) -> [Slack; N] {
        self.transmission.slack(&self.coefficients())
    }

    /// Standard deviations of the slack of each DOF.
    pub fn slack_deviation(&self) -> [SlackDeviation; N] {
        let mut found = [SlackDeviation::default(); N];
        let dofs = self.transmission.dofs().iter().zip(self.slack());
        for (index, (found, (dof, slack))) in found.iter_mut().zip(dofs).enumerate() {
            let first = index * COEFFICIENTS;
            let deviation = |row: &Row| {
                let cross = self.kalman.covariance_with(first, row);
                libm::sqrt(product_at(first, row, cross.as_slice()).max(0.0))
            };
            let half = slack.half_width / dof.unit;
            let mut by_half = dof.width;
            for (entry, gain) in by_half.iter_mut().zip(GAIN_ROW) {
                *entry = (*entry - half * gain) / slack.gain;
            }
            *found = SlackDeviation {
                half_width: dof.unit * deviation(&by_half),
                gain: deviation(&GAIN_ROW),
            };
        }
        found
    }

    /// Share of the deflection that vector plays make, of all DOFs that share a friction; 0 without such.
    pub fn shared(&self) -> f64 {
        let (mut shared, mut all) = (0.0, 0.0);
        let dofs = self.transmission.dofs().iter().zip(self.coefficients());
        for (dof, row) in dofs.filter(|(dof, _)| !dof.is_alone) {
            let parts = dof.all().zip(row).map(|(radius, weight)| radius * weight);
            shared += parts.clone().take(SHARED).sum::<f64>();
            all += parts.sum::<f64>();
        }
        (shared / all).clamp(0.0, 1.0)
    }

    /// Covariance of all coefficients with the tip of each DOF, for its regressors.
    fn crosses(&self, rows: &[Row; N]) -> SMatrix<f64, D, N> {
        let mut with = SMatrix::<f64, D, N>::zeros();
        for (index, (mut column, row)) in with.column_iter_mut().zip(rows).enumerate() {
            let own = self.kalman.covariance_with(index * COEFFICIENTS, row);
            column.copy_from(&own);
        }
        with
    }

    /// Regressors of each DOF in its unit: their product with the coefficients is the tip from the origin [m or rad].
    fn rows(&self, plays: &Plays<N>) -> [Row; N] {
        let mut rows = plays.regressors();
        for (row, unit) in rows.iter_mut().zip(self.transmission.unit()) {
            for entry in row.iter_mut() {
                *entry *= unit;
            }
        }
        rows
    }

    /// What the plays add to the tip (N,) [m or rad] of DOFs that have hardly moved yet, without these plays in their `rows`.
    ///
    /// A motion seldom begins in the middle of the slack.
    fn hold_weights_at_start(&mut self, plays: &Plays<N>, rows: &mut [Row; N]) -> [f64; N] {
        let mut known = [0.0; N];
        let means = self.coefficients();
        let dofs = self.start.iter_mut().zip(plays.command).zip(rows);
        let dofs = dofs.zip(means).zip(&mut known).enumerate();
        for (index, ((((start, command), row), mean), known)) in dofs {
            if start.left <= 0.0 {
                continue;
            }
            start.left -= (command - start.command).abs();
            start.command = command;
            if start.left <= 0.0 {
                let offset = index * COEFFICIENTS + OFFSET;
                self.kalman.add_variance(offset, start.std * start.std);
                continue;
            }
            let (weights, _) = row.split_at_mut(OFFSET);
            *known = product(weights, &mean);
            weights.fill(0.0);
        }
        known
    }

    /// Moves the means to the nearest ones, in the metric of their covariance, whose gains are within [`GAINS`].
    fn bound_gains(&mut self) {
        for index in 0..N {
            let (first, row) = (index * COEFFICIENTS, GAIN_ROW);
            let gain = product_at(first, &row, self.kalman.mean.as_slice());
            let excess = gain - gain.clamp(GAINS.0, GAINS.1);
            if excess != 0.0 {
                let with = self.kalman.covariance_with(first, &row);
                let step = -excess / product_at(first, &row, with.as_slice());
                self.kalman.mean.axpy(step, &with, 1.0);
            }
        }
    }
}

/// A row times the coefficients of the DOF that begin at `first`.
fn product_at(first: usize, row: &Row, all: &[f64]) -> f64 {
    let own = all.iter().skip(first);
    row.iter().zip(own).map(|(a, b)| a * b).sum()
}

/// The entries of the offsets of N DOFs.
fn offsets<const N: usize, const D: usize>(
    row: &mut SVector<f64, D>,
) -> impl Iterator<Item = &mut f64> {
    let of_dofs = row.iter_mut().take(N * COEFFICIENTS);
    of_dofs.skip(OFFSET).step_by(COEFFICIENTS)
}

/// A row (D,) of the coefficients of one DOF.
fn of_dof<const D: usize>(index: usize, row: &Row) -> SVector<f64, D> {
    let mut all = SVector::<f64, D>::zeros();
    let own = all.iter_mut().skip(index * COEFFICIENTS);
    own.zip(row).for_each(|(entry, value)| *entry = *value);
    all
}

/// Mean and variance of the coefficients of a DOF before the first image.
fn prior(settings: &EstimateSettings, dof: &Radii, start: &Slack) -> (Row, Row) {
    let (mut mean, mut variance) = ([0.0; COEFFICIENTS], [0.0; COEFFICIENTS]);
    // Beyond the widest play every weight would be 0.
    let widest = dof.all().fold(0.0, f64::max);
    let expected = if start.half_width > 0.0 {
        (start.half_width / dof.unit).min(widest)
    } else {
        EXPECTED
    };
    let own = settings.weight_deviation * settings.weight_deviation;
    let mut sum = 0.0;
    let plays = mean.iter_mut().zip(&mut variance).zip(dof.all());
    for (index, ((mean, variance), radius)) in plays.enumerate() {
        let off = (radius - expected) / SPREAD;
        let share = if dof.is_alone || index < SHARED {
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
    let [.., centre] = &mut mean;
    *centre = -start.centre / dof.unit;
    let [.., offset] = &mut variance;
    *offset = settings.offset_deviation * settings.offset_deviation;
    (mean, variance)
}
