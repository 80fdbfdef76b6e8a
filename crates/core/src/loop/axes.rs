//! Loops of 1 to 8 DOFs whose tip is measured by any sensor.

use nalgebra::{SMatrix, SVector};

use crate::article::estimator::Triggers;
use crate::article::play_limit::PlayLimit;
use crate::dof::{all_finite, zip_with};
use crate::error::ConfigError;
use crate::estimation::history::Entry;
use crate::estimation::measurement::{Linear, Observed, Prior, Sensor};
use crate::r#loop::any_loop::{DOFS, Loop, padded};
use crate::r#loop::best::Best;
use crate::r#loop::image_update::Outcome;
use crate::r#loop::measurement::Measurement;
use crate::r#loop::observation::Observation;
use crate::r#loop::paper::{Paper, StateEstimation};
use crate::r#loop::profile::Profile;
use crate::r#loop::reduction::HysteresisReduction;
use crate::r#loop::report::Status;
use crate::r#loop::settings::LoopSettings;
use crate::supervision::monitors::SENSORS;
pub use crate::supervision::monitors::VALUES;
pub use crate::supervision::repeat::Repeats;

/// Standard deviation by a measurement alone, in units, up to which it determines a DOF.
const OBSERVABLE: f64 = 0.5;
/// Limit of the low-passed error of the predicted tip, in units.
const SLACK_CHANGED: f64 = 0.2;
/// Gauss-Newton steps to the state that fits a measurement best.
const FIT_STEPS: usize = 3;
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
    /// Covariance (m, m) row by row, whole.
    pub covariance: &'a [f64],
    /// Values in a row that are right or wrong together: 2 for points of an image.
    pub point: usize,
    /// Time of the measurement in s, on the clock of the control ticks.
    pub captured_at: f64,
    /// Which of four sensors, 0 to 3; each has its own rate and delay.
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

/// A loop of n DOFs whose tip any sensor measures.
pub trait Axes: Loop {
    /// Update by a measurement.
    ///
    /// One without a number, with an infinite one, or in which values, covariance or sensor are not as [`Reading`] says, is not
    /// used: [`Status::NoMarkers`].
    fn on_reading(&mut self, reading: &Reading<'_>) -> AxesReport;
}

/// A profile for any sensor of N DOFs: `Paper<N, StateFromSensor<N>>`, or `Best<N, N, 0, D>` with D = N `COEFFICIENTS`.
pub trait SensorProfile<const N: usize>: Profile<N> {
    /// A profile at rest.
    ///
    /// # Errors
    /// A setting is out of range.
    fn of_axes(settings: &LoopSettings<N>, limits: [PlayLimit; N]) -> Result<Self, ConfigError>;

    /// The measurement of a sensor at a tick of the history; None where its model sees nothing.
    fn measure(
        &self,
        reading: &Reading<'_>,
        past: &Entry<N>,
    ) -> Option<(Measurement<N, Self::Evidence>, View<N>)>;
}

impl<P: SensorProfile<N>, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>, const N: usize>
    HysteresisReduction<P, S, Repeats<N>, N>
{
    /// A loop at rest, with storage for at least `control.history`.
    ///
    /// # Errors
    /// A setting is out of range, or the storage is too small.
    pub fn of_axes(settings: &LoopSettings<N>, storage: S) -> Result<Self, ConfigError> {
        const { assert!(N >= 1 && N <= DOFS) };
        let make = |limits| P::of_axes(settings, limits);
        Self::with_profile(settings, make, Repeats::default(), storage)
    }
}

impl<P: SensorProfile<N>, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>, const N: usize> Axes
    for HysteresisReduction<P, S, Repeats<N>, N>
{
    fn on_reading(&mut self, reading: &Reading<'_>) -> AxesReport {
        let stuck = self.stuck(reading).unwrap_or_default();
        let seen = reading.values.iter().zip(stuck);
        let mut known = seen.clone().filter(|(value, _)| value.is_finite());
        let is_stuck = stuck.contains(&true) && known.all(|(_, stuck)| stuck);
        let (mut values, mut covariance) = ([f64::NAN; VALUES], [0.0; VALUES * VALUES]);
        for (to, (value, stuck)) in values.iter_mut().zip(seen) {
            if is_stuck || !stuck {
                *to = *value;
            }
        }
        let reading = &Reading {
            values: values.get(..reading.values.len()).unwrap_or(reading.values),
            ..*reading
        };
        let reading = &self.weighed(reading, &mut covariance);
        self.check_start(reading);
        let outcome = self.update_by(reading, reading.captured_at, reading.sensor, None, is_stuck);
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
}

impl<P: SensorProfile<N>, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>, const N: usize>
    HysteresisReduction<P, S, Repeats<N>, N>
{
    /// Compares the command with the tip by a measurement alone, whether it is used or refused, until the direction is known.
    fn check_start(&mut self, reading: &Reading<'_>) {
        let Some(spread) = self.monitors.unknown_direction() else {
            return;
        };
        if !reading.is_consistent() {
            return;
        }
        let Some(past) = self.history.at(reading.captured_at) else {
            return;
        };
        let alone = Prior::at(past.predicted_state);
        let observed = reading.observed();
        let rows = observed.linearize(reading, &alone, observed.seen, &[0.0; N]);
        let found = rows.map(compressed).and_then(|rows| {
            let observable = determined(&rows.by_state, spread);
            let (state, std) = least_squares(&rows, past.predicted_state, observable)?;
            // Without a standard deviation it is not determined.
            let known = |state, std: f64| if std.is_finite() { state } else { f64::NAN };
            Some(zip_with(state, std, known))
        });
        if let Some(measured) = found {
            self.monitors.check_start(past.command, measured);
        }
    }
}

impl<P, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>, const N: usize>
    HysteresisReduction<P, S, Repeats<N>, N>
{
    /// Which values of a reading are stuck; None where that is not known.
    fn stuck(&mut self, reading: &Reading<'_>) -> Option<[bool; VALUES]> {
        let past = self.history.at(reading.captured_at)?;
        let travel = self.monitors.frozen_travel()?;
        let at = |state| Sensor::<N, VALUES, 0>::features(reading, &state, &[]);
        let change = |index: usize, from| {
            let ((now, by), (then, _)) = (at(past.command)?, at(from)?);
            let parts = by.iter().zip(travel);
            let most = parts.map(|(by, travel)| by.get(index).map_or(0.0, |by| by.abs() * travel));
            Some((now.get(index)? - then.get(index)?).abs() > most.sum())
        };
        let is_far = |index, from| change(index, from).unwrap_or(false);
        let (sensor, command) = (reading.sensor, past.command);
        Some(self.view.update(sensor, reading.values, command, is_far))
    }

    /// A reading with the covariance that its sensor has shown to have.
    fn weighed<'a>(&mut self, reading: &Reading<'a>, covariance: &'a mut [f64]) -> Reading<'a> {
        let past = self.history.at(reading.captured_at);
        let misfit = past.and_then(|past| reading.misfit(past.predicted_state));
        let scale = self.monitors.fit(misfit, reading.sensor);
        let Some(covariance) = covariance.get_mut(..reading.covariance.len()) else {
            return *reading;
        };
        let told = covariance.iter_mut().zip(reading.covariance);
        told.for_each(|(to, told)| *to = scale * told);
        Reading {
            covariance,
            ..*reading
        }
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

impl<P: SensorProfile<N>, const N: usize> Observation<P, N> for Reading<'_> {
    type View = View<N>;

    const IS_WHOLE: bool = false;

    fn is_usable(&self) -> bool {
        let known = |value: &f64| value.is_finite();
        self.is_consistent()
            && self.values.iter().any(known)
            && self.values.iter().all(|v| known(v) || v.is_nan())
    }

    fn measure(
        &self,
        profile: &P,
        past: &Entry<N>,
    ) -> Option<(Measurement<N, P::Evidence>, View<N>)> {
        profile.measure(self, past)
    }
}

impl<const N: usize, const D: usize> SensorProfile<N> for Best<N, N, 0, D> {
    fn of_axes(settings: &LoopSettings<N>, limits: [PlayLimit; N]) -> Result<Self, ConfigError> {
        Self::with_geometry(settings, limits, [], [SLACK_CHANGED; N])
    }

    fn measure(
        &self,
        reading: &Reading<'_>,
        _: &Entry<N>,
    ) -> Option<(Measurement<N, Self::Evidence>, View<N>)> {
        let prior = self.estimate.prior(&self.measured);
        let observed = reading.observed();
        let price = self.settings.outlier_distance;
        let found = observed.most_probable(reading, &prior, around(), price)?;
        let linear = observed.linearize(reading, &prior, found.used, &self.estimate.noise())?;
        let rows = compressed(linear);
        let observable = determined(&rows.by_state, self.estimate.transmission.unit());
        let used = found.used.iter().filter(|used| **used).count();
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let per_dof = N as f64 / used.max(N) as f64;
        let measurement = Measurement {
            state: found.state,
            observable,
            distance: libm::sqrt(found.distance_squared * per_dof),
            is_partial: reading.is_partial(),
            has_outlier: found.used != observed.seen,
            evidence: rows,
        };
        let view = reading.view(prior.state.into(), found.state, found.std, observable)?;
        Some((measurement, view))
    }
}

/// State estimation of profile `paper` from any sensor: one linear step of least squares, Eqs. (13)-(16).
#[derive(Debug, Clone, PartialEq)]
pub struct StateFromSensor<const N: usize> {
    unit: [f64; N],
}

impl<const N: usize> StateEstimation<N> for StateFromSensor<N> {}

impl<const N: usize> SensorProfile<N> for Paper<N, StateFromSensor<N>> {
    fn of_axes(settings: &LoopSettings<N>, limits: [PlayLimit; N]) -> Result<Self, ConfigError> {
        let unit = settings.transmission()?.unit();
        Self::with_estimation(&settings.dofs, limits, StateFromSensor { unit })
    }

    /// The step starts from the state prediction of the last measurements: a DOF that is not determined is held there.
    fn measure(
        &self,
        reading: &Reading<'_>,
        past: &Entry<N>,
    ) -> Option<(Measurement<N, Self::Evidence>, View<N>)> {
        let predicted = self.prior(past);
        let prior = Prior::at(predicted.state);
        let observed = reading.observed();
        let rows = compressed(observed.linearize(reading, &prior, observed.seen, &[0.0; N])?);
        let observable = determined(&rows.by_state, self.estimation.unit);
        let (state, std) = least_squares(&rows, predicted.state, observable)?;
        let measurement = Measurement {
            state,
            observable,
            distance: self.distance(past, &predicted, state, std, observable),
            is_partial: reading.is_partial(),
            has_outlier: false,
            evidence: std,
        };
        let view = reading.view(predicted.state, state, std, observable)?;
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
    /// Whether there are not too many values, a covariance of all of them, and such a sensor.
    fn is_consistent(&self) -> bool {
        let count = self.values.len();
        count <= VALUES && self.covariance.len() == count * count && self.sensor < SENSORS
    }

    /// Mean squared misfit, in told standard deviations, of the values that no state near a given one (N,) explains; None
    /// where a state explains all.
    fn misfit<const N: usize>(&self, mut state: [f64; N]) -> Option<f64> {
        if !self.is_consistent() {
            return None;
        }
        let observed = self.observed();
        let seen = self.values.iter().filter(|value| value.is_finite());
        let seen = seen.count();
        let mut misfit = None;
        for _ in 0..FIT_STEPS {
            let rows = observed.linearize(self, &Prior::at(state), observed.seen, &[0.0; N])?;
            let fitted = compressed(rows);
            let known = fitted.by_state.diagonal().map(|entry| entry != 0.0);
            let rank = known.iter().filter(|known| **known).count();
            let redundant = seen.checked_sub(rank).filter(|count| *count > 0)?;
            let at = SVector::from(state);
            let whole = (rows.value - rows.by_state * at).norm_squared();
            let explained = (fitted.value - fitted.by_state * at).norm_squared();
            #[expect(clippy::cast_precision_loss, reason = "a small number")]
            let mean = (whole - explained).max(0.0) / redundant as f64;
            misfit = Some(mean);
            (state, _) = least_squares(&fitted, state, known.into())?;
        }
        misfit.filter(|misfit| misfit.is_finite())
    }

    fn is_partial(&self) -> bool {
        self.values.iter().any(|value| value.is_nan())
    }

    /// What a report says of it, with the values that are expected in a state.
    fn view<const N: usize>(
        &self,
        expected: [f64; N],
        state: [f64; N],
        std: [f64; N],
        observable: [bool; N],
    ) -> Option<View<N>> {
        let (expected, _) = Sensor::<N, VALUES, 0>::features(self, &expected, &[])?;
        let (mut predicted, mut innovation) = ([f64::NAN; VALUES], [f64::NAN; VALUES]);
        let known = predicted.iter_mut().zip(&mut innovation);
        for ((predicted, innovation), (expected, value)) in
            known.zip(expected.iter().zip(self.values))
        {
            (*predicted, *innovation) = (*expected, value - expected);
        }
        Some(View {
            state,
            std,
            observable,
            predicted,
            innovation,
        })
    }

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

/// The state (N,) with its standard deviations by least squares, Eq. (16): a DOF that is not `observable` stays where it is,
/// with a standard deviation of NaN.
fn least_squares<const N: usize>(
    rows: &Linear<N, N, 0>,
    state: [f64; N],
    observable: [bool; N],
) -> Option<([f64; N], [f64; N])> {
    let (state, mut by_state) = (SVector::from(state), rows.by_state);
    let innovation = rows.value - by_state * state;
    let mut held = SVector::<f64, N>::zeros();
    let columns = by_state.column_iter_mut().zip(held.iter_mut());
    for ((mut column, held), _) in columns.zip(observable).filter(|(_, known)| !known) {
        column.fill(0.0);
        *held = 1.0;
    }
    let normal = by_state.tr_mul(&by_state) + SMatrix::from_diagonal(&held);
    let factor = normal.cholesky()?;
    let step = factor.solve(&by_state.tr_mul(&innovation));
    let mut std: [f64; N] = factor.inverse().diagonal().map(libm::sqrt).into();
    for (std, _) in std.iter_mut().zip(observable).filter(|(_, known)| !known) {
        *std = f64::NAN;
    }
    Some(((state + step).into(), std))
}
