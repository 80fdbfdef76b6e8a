//! Profile `paper`: the article's compensator, estimator and state estimation, Eqs. (2)-(6) and (13)-(16).

use core::f64::consts::{FRAC_PI_2, PI};

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::estimator::{Estimator, EstimatorState, Triggers};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::article::state::{StateEstimator, found};
use crate::dof::{PerDof, try_each, zip_with};
use crate::error::ConfigError;
use crate::estimation::expectation::StatePrior;
use crate::estimation::history::{Entry, History};
use crate::estimation::state_prediction::{StatePrediction, step_deviation};
use crate::r#loop::measurement::Measurement;
use crate::r#loop::profile::{BandProfile, BandsView, Image, Profile, Seen, Updated};
use crate::r#loop::settings::LoopSettings;
use crate::model::features::FeatureModel;
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::monitors::Law;

/// Covariance of features that come without one, in px^2.
const UNIT: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

/// Error of a linear step by that of another DOF, in `start_deviation`.
const COUPLED: f64 = 0.08;

/// Profile `paper`: compensators and estimators of N DOFs, and the state estimation `E`.
#[derive(Debug, Clone, PartialEq)]
pub struct Paper<const N: usize = 3, E = StateFromImages> {
    axes: [ArticleAxis; N],
    /// Sum of the changes of the predicted state by images so far.
    corrected: [f64; N],
    prediction: StatePrediction<N>,
    coupled_std: [f64; N],
    pub(super) estimation: E,
}

/// How profile `paper` estimates the state.
pub trait StateEstimation<const N: usize>: Sized {
    /// A state by the name that is nearest to the predicted state, where one posture has several.
    fn named(_predicted: [f64; N], state: [f64; N]) -> [f64; N] {
        state
    }
}

/// State estimation from images, Eqs. (13)-(16).
#[derive(Debug, Clone, PartialEq)]
pub struct StateFromImages(StateEstimator);

impl StateEstimation<3> for StateFromImages {
    /// The same posture by another name, which images never tell apart:
    ///
    /// ```text
    /// (q1, q2, q3) = (q1, q2 + pi, -q3) = (q1, q2 - pi, -q3)
    /// ```
    ///
    /// Wrong where the rotation is expected a quarter of a turn off.
    fn named([_, predicted, _]: PerDof<f64>, state: PerDof<f64>) -> PerDof<f64> {
        let [insertion, rotation, bending] = state;
        let away = rotation - predicted;
        if away.abs() > FRAC_PI_2 {
            [insertion, rotation - PI.copysign(away), -bending]
        } else {
            // Minus zero plus zero is another number.
            [insertion, rotation + 0.0, bending]
        }
    }
}

impl<const N: usize, E> Law<N> for Paper<N, E> {
    fn command(&self) -> [f64; N] {
        self.axes.each_ref().map(|axis| axis.compensation.command())
    }

    fn propose(&mut self, reference: [f64; N]) -> [f64; N] {
        let mut command = reference;
        for (axis, value) in self.axes.iter_mut().zip(&mut command) {
            *value = axis.compensator.propose(&mut axis.compensation, *value);
        }
        command
    }

    fn commit(&mut self, command: [f64; N]) {
        for (axis, command) in self.axes.iter_mut().zip(command) {
            axis.compensator.commit(&mut axis.compensation, command);
        }
    }

    fn shift_reference(&mut self, shift: [f64; N]) {
        for (axis, shift) in self.axes.iter_mut().zip(shift) {
            if shift != 0.0 {
                axis.compensator
                    .shift_reference(&mut axis.compensation, shift);
            }
        }
    }

    fn set_share(&mut self, share: f64) {
        for axis in &mut self.axes {
            axis.set_share(share);
        }
    }
}

impl<const N: usize, E: StateEstimation<N>> Profile<N> for Paper<N, E> {
    /// Standard deviation of the state estimate.
    type Evidence = [f64; N];

    const IS_COUPLED: bool = false;

    fn predicted_state(&self) -> [f64; N] {
        self.axes
            .each_ref()
            .map(|axis| axis.compensation.predicted_state())
    }

    fn corrected(&self) -> [f64; N] {
        self.corrected
    }

    fn play(&self) -> [Play; N] {
        self.axes.each_ref().map(|axis| axis.estimation.play())
    }

    fn update(
        &mut self,
        past: &Entry<N>,
        measurement: &Measurement<N, Self::Evidence>,
        updates_offsets: bool,
    ) -> Updated<N> {
        let (state, observable) = (measurement.state, measurement.observable);
        let std = step_deviation(past, state, measurement.evidence);
        self.prediction.set(past, state, std, observable);
        if !updates_offsets {
            return ([Triggers::default(); N], Flags::NONE);
        }
        self.update_offsets(past.command, state, observable)
    }

    fn miss(&mut self, past: &Entry<N>) {
        self.prediction.miss(past, &self.prior(past));
    }

    fn reset_prediction(&mut self, past: &Entry<N>) {
        self.prediction.reset(past, &self.prior(past));
    }
}

impl BandProfile for Paper {
    fn new(settings: &LoopSettings<3>, limits: PerDof<PlayLimit>) -> Result<Self, ConfigError> {
        let estimation = StateFromImages(state_estimator(&settings.dofs)?);
        Self::with_estimation(&settings.dofs, limits, estimation)
    }

    fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        _: &History<S>,
        past: &Entry,
    ) -> StatePrior {
        self.prior(past)
    }

    /// One linear step from the prediction, Eqs. (13)-(16). With one band the step starts from the state prediction of the
    /// last images, because the DOFs that are held keep its error.
    fn measure(
        &self,
        model: &FeatureModel,
        past: &Entry,
        image: Image<'_>,
    ) -> Option<Seen<Self::Evidence>> {
        let used @ [a, b] = found(image.features);
        let prior = self.prior(past);
        let start = if used == [true; 2] {
            past.predicted_state
        } else {
            prior.state
        };
        let prediction = model.predict(start)?;
        let StateFromImages(estimator) = &self.estimation;
        let estimate = estimator.estimate(start, &prediction, image.features);
        let state_deviation = estimate.state_deviation(image.covariance.unwrap_or(&UNIT));
        let (state, observable) = (estimate.state, estimate.observable);
        let measurement = Measurement {
            state,
            observable,
            distance: self.distance(past, &prior, state, state_deviation, observable),
            is_partial: a != b,
            has_outlier: false,
            evidence: state_deviation,
        };
        let view = BandsView {
            estimate,
            used,
            predicted_features: prediction.features,
            state_deviation,
        };
        Some((measurement, view))
    }
}

impl<const N: usize, E: StateEstimation<N>> Paper<N, E> {
    /// The state prediction at a moment of the history.
    pub(super) fn prior(&self, past: &Entry<N>) -> StatePrior<N> {
        let prior = self.prediction.at(past);
        StatePrior {
            state: E::named(past.predicted_state, prior.state),
            ..prior
        }
    }

    /// Largest innovation of a DOF, measured less predicted state, in standard deviations of prediction and measurement
    /// together, and of what the error of another DOF makes of a linear step.
    pub(super) fn distance(
        &self,
        past: &Entry<N>,
        prior: &StatePrior<N>,
        state: [f64; N],
        std: [f64; N],
        observable: [bool; N],
    ) -> f64 {
        let innovations = state.into_iter().zip(prior.state);
        let stds = step_deviation(past, prior.state, std);
        let stds = stds.into_iter().zip(prior.deviation).zip(self.coupled_std);
        innovations
            .zip(stds)
            .zip(observable)
            .filter(|(_, observable)| *observable)
            .map(|(((state, predicted), ((own, prior), coupled)), _)| {
                let variance = own * own + prior * prior + coupled * coupled;
                (state - predicted).abs() / libm::sqrt(variance)
            })
            .filter(|distance| distance.is_finite())
            .fold(0.0, f64::max)
    }
}

impl<const N: usize, E> Paper<N, E> {
    /// The profile at rest, with the limits of the offsets.
    ///
    /// # Errors
    /// As [`Compensator::new`], [`Compensator::with_recovery`], [`Estimator::new`] and [`Play::new`].
    pub(crate) fn with_estimation(
        dofs: &[DofSettings; N],
        limits: [PlayLimit; N],
        estimation: E,
    ) -> Result<Self, ConfigError> {
        let axes = try_each(*dofs, |dof| ArticleAxis::new(&dof))?;
        Ok(Self {
            axes: zip_with(axes, limits, |axis, limit| ArticleAxis { limit, ..axis }),
            corrected: [0.0; N],
            prediction: StatePrediction::new(dofs.map(|dof| dof.start_deviation))?,
            coupled_std: dofs.map(|dof| COUPLED * dof.start_deviation),
            estimation,
        })
    }

    /// Updates the offsets of the DOFs that were `observed` from command and state of one instant: which were updated
    /// and why, and the flags raised.
    pub(crate) fn update_offsets(
        &mut self,
        command: [f64; N],
        state: [f64; N],
        observed: [bool; N],
    ) -> Updated<N> {
        let (mut triggers, mut raised) = ([Triggers::default(); N], Flags::NONE);
        let axes = self
            .axes
            .iter_mut()
            .zip(&mut self.corrected)
            .zip(&mut triggers);
        let signals = command.into_iter().zip(state).zip(observed);
        for (((axis, corrected), triggers), ((command, state), observed)) in axes.zip(signals) {
            if !observed {
                continue;
            }
            let before = axis.compensation.predicted_state();
            let is_limited;
            (*triggers, is_limited) = axis.update_offsets(command, state);
            raised = raised.union(Flags::when(is_limited, Flag::WidthLimit));
            let moved = axis.compensation.predicted_state() - before;
            *corrected += if moved.is_finite() { moved } else { 0.0 };
        }
        (triggers, raised)
    }
}

/// The state estimation with its rank monitored, Eqs. (13)-(16).
///
/// # Errors
/// An `observable_deviation` is not above 0.
pub fn state_estimator(dofs: &PerDof<DofSettings>) -> Result<StateEstimator, ConfigError> {
    StateEstimator::new(dofs.map(|dof| dof.observable_deviation))
}

/// Compensator and estimator of one DOF, each with its state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArticleAxis {
    /// The compensator of the configuration; `compensator` uses a share of its free gain.
    configured: Compensator,
    compensator: Compensator,
    estimator: Estimator,
    compensation: CompensatorState,
    estimation: EstimatorState,
    limit: PlayLimit,
}

impl ArticleAxis {
    fn new(dof: &DofSettings) -> Result<Self, ConfigError> {
        let compensator =
            Compensator::new(dof.free_gain, dof.gain_limit)?.with_recovery(dof.recovery)?;
        let play = Play::new(dof.delta_minus, dof.delta_plus)?;
        Ok(Self {
            configured: compensator,
            compensator,
            estimator: Estimator::new(
                dof.update_distance,
                dof.contact_tolerance,
                dof.smoothing_factor,
            )?,
            compensation: CompensatorState::new(play),
            estimation: EstimatorState::new(play),
            limit: PlayLimit::NONE,
        })
    }

    fn set_share(&mut self, share: f64) {
        self.compensator = self.configured.with_share(share);
        let play = self.compensation.play();
        self.compensator.retune(&mut self.compensation, play);
    }

    /// Updates the offsets from command and output of one instant: which were updated and why, and whether the limit
    /// bounded them. An offset beyond the limit updates nothing.
    fn update_offsets(&mut self, command: f64, measured: f64) -> (Triggers, bool) {
        if !self.limit.allows(command - measured) {
            return (Triggers::default(), true);
        }
        let triggers = self
            .estimator
            .update(&mut self.estimation, command, measured);
        let is_limited = self.estimation.limit(self.limit);
        if triggers.any() {
            self.compensator
                .retune(&mut self.compensation, self.estimation.play());
        }
        (triggers, is_limited)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_posture_goes_by_the_name_nearer_to_what_is_expected() {
        for turns in -8_i32..=8 {
            let rotation = 0.1 + 0.35 * f64::from(turns);
            let state = [0.03, rotation, 0.9];
            let expected = [0.0, 0.2, 1.0];
            let [insertion, named, bending] = StateFromImages::named(expected, state);
            assert!((named - 0.2).abs() <= FRAC_PI_2 + 1e-12, "{rotation}");
            let turns = (named - rotation) / PI;
            assert!((turns - turns.round()).abs() < 1e-12 && turns.abs() < 1.5);
            let side = if turns.abs() > 0.5 { -0.9 } else { 0.9 };
            assert!((insertion - 0.03).abs() + (bending - side).abs() < 1e-12);
        }
    }
}
