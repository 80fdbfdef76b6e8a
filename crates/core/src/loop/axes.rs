//! Loops of 1 to 8 DOFs whose tip is measured by any sensor.

use nalgebra::{SMatrix, SVector};

use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::dof::all_finite;
use crate::error::ConfigError;
use crate::estimation::history::Entry;
use crate::estimation::measurement::{Linear, Observed, Sensor};
use crate::r#loop::best::Best;
use crate::r#loop::image_update::Outcome;
use crate::r#loop::measurement::Measurement;
use crate::r#loop::reduction::HysteresisReduction;
use crate::r#loop::report::Status;
use crate::r#loop::settings::LoopSettings;
use crate::r#loop::sight::Sight;
use crate::supervision::flags::Flag;
use crate::supervision::frame_gate::ImageIdentity;
use crate::supervision::monitors::Supervision;

/// Most DOFs of a loop.
pub const DOFS: usize = 8;
/// Most values of a measurement.
pub const VALUES: usize = 16;

/// Standard deviation by a measurement alone, in units, up to which it determines a DOF.
const OBSERVABLE: f64 = 0.5;
/// Limit of the low-passed error of the predicted tip, in units.
const SLACK_CHANGED: f64 = 0.2;
/// Part of a column that no other explains, over the column, below which it is rounding.
const ROUNDING: f64 = 1e-9;

/// What a sensor would measure.
pub trait Predict {
    /// Writes the values z (m,) in a state (n,) [m or rad], and dz/dq (m, n) row by row.
    ///
    /// False where the sensor sees nothing.
    fn predict(&self, state: &[f64], values: &mut [f64], jacobian: &mut [f64]) -> bool;
}

/// A measurement.
#[derive(Clone, Copy)]
pub struct Reading<'a> {
    /// Values (m,), at most [`VALUES`]; NaN for one that was not measured.
    pub values: &'a [f64],
    /// Covariance (m, m) row by row.
    pub covariance: &'a [f64],
    /// Values in a row that are right or wrong together: 2 for points of an image.
    pub point: usize,
    /// Time of the measurement in s, on the clock of the control ticks.
    pub captured_at: f64,
    /// Which of four sensors; each has its own rate and delay.
    pub sensor: usize,
    /// The model of the sensor.
    pub model: &'a dyn Predict,
}

/// Result of an update by a measurement. Of n DOFs and m values the first n and m entries are used; unknown ones are NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxesReport {
    /// Whether the measurement was used, or why not.
    pub status: Status,
    /// q at the time of the measurement [m or rad].
    pub predicted_state: [f64; DOFS],
    /// The most probable state [m or rad].
    pub state: [f64; DOFS],
    /// Its standard deviations [m or rad].
    pub state_deviation: [f64; DOFS],
    /// Which DOFs the measurement determined.
    pub observable: [bool; DOFS],
    /// Values expected in the predicted state.
    pub predicted: [f64; VALUES],
    /// Measured less expected values.
    pub innovation: [f64; VALUES],
    /// Which offsets were updated, and why.
    pub triggers: [Triggers; DOFS],
}

/// Estimated hysteresis of n DOFs, in the first n entries [m or rad].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxesHysteresis {
    /// Half widths.
    pub half_width: [f64; DOFS],
    /// Standard deviations of the half widths.
    pub width_std: [f64; DOFS],
    /// Centres of the contact offsets, input minus output.
    pub centre: [f64; DOFS],
    /// Travel of the tip over that of the command in contact.
    pub gain: [f64; DOFS],
    /// Standard deviations of the gains.
    pub gain_std: [f64; DOFS],
}

/// A loop of N DOFs, D = N `COEFFICIENTS`, with profile `best`.
pub type AxesReduction<const N: usize, const D: usize, S> =
    HysteresisReduction<Best<N, N, 0, D>, S, (), N>;

/// A loop whose number of DOFs n is known at run time: arrays have n entries, or n of `DOFS`.
pub trait Axes {
    /// Number of DOFs.
    fn dofs(&self) -> usize;

    /// Control tick, as [`HysteresisReduction::step`]: `command` (n,) for a reference (n,).
    fn step(&mut self, reference: &[f64], stamp: Option<f64>, time: f64, command: &mut [f64]);

    /// Update by a measurement.
    fn on_reading(&mut self, reading: &Reading<'_>) -> AxesReport;

    /// The predicted state now.
    fn predicted_state(&self) -> [f64; DOFS];

    /// The estimated contact offsets.
    fn play(&self) -> [Play; DOFS];

    /// The estimated hysteresis.
    fn hysteresis(&self) -> AxesHysteresis;

    /// State of the supervision.
    fn supervision(&self) -> Supervision;

    /// As [`HysteresisReduction::set_compensation`].
    ///
    /// # Errors
    /// The share is not from 0 to 1.
    fn set_compensation(&mut self, share: f64) -> Result<(), ConfigError>;

    /// As [`HysteresisReduction::engage`].
    fn engage(&mut self);

    /// As [`HysteresisReduction::acknowledge`].
    fn acknowledge(&mut self);

    /// As [`HysteresisReduction::raise`].
    fn raise(&mut self, flag: Flag);
}

impl<const N: usize, const D: usize, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>>
    AxesReduction<N, D, S>
{
    /// A loop at rest, with storage for at least `control.history`.
    ///
    /// # Errors
    /// A setting is out of range, or the storage is too small.
    pub fn of_axes(settings: &LoopSettings<N>, storage: S) -> Result<Self, ConfigError> {
        const { assert!(N >= 1 && N <= DOFS) };
        let make = |limits| Best::with_geometry(settings, limits, [], [SLACK_CHANGED; N], f64::NAN);
        Self::with_profile(settings, make, (), storage)
    }
}

impl<const N: usize, const D: usize, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>> Axes
    for AxesReduction<N, D, S>
{
    fn dofs(&self) -> usize {
        N
    }

    fn step(&mut self, reference: &[f64], stamp: Option<f64>, time: f64, command: &mut [f64]) {
        let next = Self::step(self, taken(reference), stamp, time);
        command.iter_mut().zip(next).for_each(|(to, of)| *to = of);
    }

    fn on_reading(&mut self, reading: &Reading<'_>) -> AxesReport {
        let identity = identity(reading.values);
        let outcome = self.update_by(reading, reading.captured_at, reading.sensor, identity);
        let Outcome {
            status,
            past,
            seen,
            triggers,
        } = outcome;
        let predicted_state = past.map_or([f64::NAN; N], |past| past.predicted_state);
        let unseen = || View {
            state: predicted_state,
            std: [f64::NAN; N],
            observable: [false; N],
            predicted: [f64::NAN; VALUES],
            innovation: [f64::NAN; VALUES],
        };
        let view = seen.unwrap_or_else(unseen);
        AxesReport {
            status,
            predicted_state: padded(predicted_state, f64::NAN),
            state: padded(view.state, f64::NAN),
            state_deviation: padded(view.std, f64::NAN),
            observable: padded(view.observable, false),
            predicted: view.predicted,
            innovation: view.innovation,
            triggers: padded(triggers, Triggers::default()),
        }
    }

    fn predicted_state(&self) -> [f64; DOFS] {
        padded(Self::predicted_state(self), f64::NAN)
    }

    fn play(&self) -> [Play; DOFS] {
        padded(Self::play(self), Play::from_ordered(f64::NAN, f64::NAN))
    }

    fn hysteresis(&self) -> AxesHysteresis {
        let (slack, deviation) = (self.profile.slack, self.profile.estimate.slack_deviation());
        let all = |values| padded(values, f64::NAN);
        AxesHysteresis {
            half_width: all(slack.map(|own| own.half_width)),
            width_std: all(deviation.map(|own| own.half_width)),
            centre: all(slack.map(|own| own.centre)),
            gain: all(slack.map(|own| own.gain)),
            gain_std: all(deviation.map(|own| own.gain)),
        }
    }

    fn supervision(&self) -> Supervision {
        Self::supervision(self)
    }

    fn set_compensation(&mut self, share: f64) -> Result<(), ConfigError> {
        Self::set_compensation(self, share)
    }

    fn engage(&mut self) {
        Self::engage(self);
    }

    fn acknowledge(&mut self) {
        Self::acknowledge(self);
    }

    fn raise(&mut self, flag: Flag) {
        Self::raise(self, flag);
    }
}

/// What a report says of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View<const N: usize> {
    state: [f64; N],
    std: [f64; N],
    observable: [bool; N],
    predicted: [f64; VALUES],
    innovation: [f64; VALUES],
}

impl<const N: usize, const D: usize> Sight<Best<N, N, 0, D>, N> for Reading<'_> {
    type View = View<N>;

    const IS_WHOLE: bool = false;

    fn is_usable(&self) -> bool {
        let known = |value: &f64| value.is_finite();
        self.values.iter().any(known) && self.values.iter().all(|v| known(v) || v.is_nan())
    }

    fn measure(
        &self,
        profile: &Best<N, N, 0, D>,
        _: &Entry<N>,
    ) -> Option<(Measurement<N, Linear<N, N, 0>>, View<N>)> {
        let prior = profile.estimate.prior(&profile.measured);
        let observed = self.observed();
        let price = profile.settings.outlier_distance;
        let found = observed.most_probable(self, &prior, around(), price)?;
        let linear = observed.linearize(self, &prior, found.used, &profile.estimate.noise())?;
        let (expected, _) = Sensor::<N, VALUES, 0>::features(self, &prior.state.into(), &[])?;
        let rows = compressed(linear);
        let observable = determined(&rows.by_state, profile.estimate.transmission().unit());
        let used = found.used.iter().filter(|used| **used).count();
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let per_dof = N as f64 / used.max(N) as f64;
        let measurement = Measurement {
            state: found.state,
            observable,
            distance: libm::sqrt(found.distance_squared * per_dof),
            is_partial: self.values.iter().any(|value| value.is_nan()),
            has_outlier: found.used != observed.seen,
            evidence: rows,
        };
        let mut predicted = [f64::NAN; VALUES];
        let known = predicted.iter_mut().zip(expected).zip(self.values);
        known.for_each(|((to, of), _)| *to = of);
        let view = View {
            state: found.state,
            std: found.std,
            observable,
            predicted,
            innovation: (observed.features - SVector::from(predicted)).into(),
        };
        Some((measurement, view))
    }
}

impl<const N: usize> Sensor<N, VALUES, 0> for Reading<'_> {
    fn point(&self) -> usize {
        self.point.max(1)
    }

    fn features(
        &self,
        state: &[f64; N],
        _: &[f64; 0],
    ) -> Option<([f64; VALUES], [[f64; VALUES]; N])> {
        let (mut values, mut rows) = ([0.0; VALUES], [0.0; VALUES * DOFS]);
        let count = self.values.len();
        let is_seen =
            self.model
                .predict(state, values.get_mut(..count)?, rows.get_mut(..count * N)?);
        let mut columns = [[0.0; VALUES]; N];
        for (index, row) in rows.chunks_exact(N).take(count).enumerate() {
            for (column, by) in columns.iter_mut().zip(row) {
                *column.get_mut(index)? = *by;
            }
        }
        let is_finite = all_finite(values) && columns.iter().all(|column| all_finite(*column));
        (is_seen && is_finite).then_some((values, columns))
    }

    fn by_geometry(&self, _: &[f64; N], _: &[f64; 0]) -> Option<[[f64; VALUES]; 0]> {
        Some([])
    }
}

impl Reading<'_> {
    fn observed(&self) -> Observed<VALUES> {
        let mut features = SVector::<f64, VALUES>::repeat(f64::NAN);
        let mut seen = [false; VALUES];
        for ((to, seen), value) in features.iter_mut().zip(&mut seen).zip(self.values) {
            *to = *value;
            *seen = value.is_finite();
        }
        let mut covariance = SMatrix::<f64, VALUES, VALUES>::identity();
        let count = self.values.len();
        for (line, row) in self.covariance.chunks_exact(count.max(1)).enumerate() {
            for (column, value) in row.iter().enumerate() {
                if let Some(entry) = covariance.get_mut((line, column)) {
                    *entry = *value;
                }
            }
        }
        Observed {
            features,
            covariance,
            seen,
        }
    }
}

/// A standard deviation to either side along each axis of the factor of a covariance.
fn around<const N: usize>() -> impl Iterator<Item = SVector<f64, N>> {
    (0..2 * N).map(|start| {
        let side = if start % 2 == 0 { 1.0 } else { -1.0 };
        SVector::from_fn(|index, _| if index == start / 2 { side } else { 0.0 })
    })
}

/// As many rows as DOFs that say the same of the state: the triangular factor of the rows, by Gram and Schmidt.
fn compressed<const N: usize>(linear: Linear<N, VALUES, 0>) -> Linear<N, N, 0> {
    let mut columns = linear.by_state;
    let mut rows = Linear {
        by_state: SMatrix::<f64, N, N>::zeros(),
        by_geometry: SMatrix::zeros(),
        value: SVector::<f64, N>::zeros(),
    };
    let whole = linear.by_state.column_iter().map(|column| column.norm());
    let mut directions = rows.by_state.row_iter_mut().zip(rows.value.iter_mut());
    for (index, whole) in whole.enumerate() {
        let own = columns.column(index).into_owned();
        let norm = own.norm();
        let Some((mut row, value)) = directions.next() else {
            break;
        };
        if norm <= ROUNDING * whole || norm == 0.0 {
            continue;
        }
        let direction = own / norm;
        *value = direction.dot(&linear.value);
        let columns = columns.column_iter_mut().zip(row.iter_mut()).skip(index);
        for (mut column, entry) in columns {
            *entry = direction.dot(&column);
            column.axpy(-*entry, &direction, 1.0);
        }
    }
    rows
}

/// Which DOFs rows of standard deviation 1 determine by themselves.
fn determined<const N: usize>(rows: &SMatrix<f64, N, N>, unit: [f64; N]) -> [bool; N] {
    let mut scaled = *rows;
    for (mut column, unit) in scaled.column_iter_mut().zip(unit) {
        column *= unit;
    }
    let least = SMatrix::<f64, N, N>::identity() * ROUNDING;
    let known = (scaled.tr_mul(&scaled) + least).cholesky();
    known.map_or([false; N], |factor| {
        let variance: [f64; N] = factor.inverse().diagonal().into();
        variance.map(|variance| variance < OBSERVABLE * OBSERVABLE)
    })
}

/// A checksum of the bits of values (Fowler, Noll, Vo); None without a number.
fn identity(values: &[f64]) -> Option<ImageIdentity> {
    let known = values.iter().any(|value| value.is_finite());
    let mix = |sum: u64, value: &f64| (sum ^ value.to_bits()).wrapping_mul(0x0100_0000_01b3);
    known.then(|| ImageIdentity::Checksum(values.iter().fold(0xcbf2_9ce4_8422_2325, mix)))
}

fn taken<const N: usize>(values: &[f64]) -> [f64; N] {
    let mut taken = [f64::NAN; N];
    taken.iter_mut().zip(values).for_each(|(to, of)| *to = *of);
    taken
}

fn padded<T: Copy, const N: usize>(values: [T; N], fill: T) -> [T; DOFS] {
    let mut padded = [fill; DOFS];
    padded.iter_mut().zip(values).for_each(|(to, of)| *to = of);
    padded
}
