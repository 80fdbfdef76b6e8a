//! Profile `paper`: the article's compensator, estimator and state estimation, Eqs. (2)-(6) and (13)-(16).

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::estimator::{Estimator, EstimatorState, Triggers};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::article::state::{StateEstimate, StateEstimator, found};
use crate::dof::{PerDof, try_each, zip_with};
use crate::error::ConfigError;
use crate::estimation::expectation::Belief;
use crate::estimation::history::{Entry, History};
use crate::estimation::state_prediction::{StatePrediction, step_deviation};
use crate::r#loop::image_update::completeness;
use crate::r#loop::measurement::Measurement;
use crate::r#loop::profile::{BandBlocks, BandsView, Image, ProfileBlocks, Seen, Updated};
use crate::r#loop::settings::Settings;
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
    estimation: E,
}

/// State estimation from images, Eqs. (13)-(16), with its prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct StateFromImages {
    estimator: StateEstimator,
    prediction: StatePrediction,
    coupled_std: PerDof<f64>,
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

impl ProfileBlocks<3> for Paper {
    type Evidence = (StateEstimate, PerDof<f64>);

    const IS_COUPLED: bool = false;

    fn predicted_state(&self) -> PerDof<f64> {
        self.axes
            .each_ref()
            .map(|axis| axis.compensation.predicted_state())
    }

    fn corrected(&self) -> PerDof<f64> {
        self.corrected
    }

    fn play(&self) -> PerDof<Play> {
        self.axes.each_ref().map(|axis| axis.estimation.play())
    }

    fn keep_up<S: AsRef<[Entry]> + AsMut<[Entry]>>(&mut self, _: &History<S>, _: bool) {}

    fn advance<S: AsRef<[Entry]> + AsMut<[Entry]>>(&mut self, _: &History<S>, _: &Entry) {}

    fn update(
        &mut self,
        past: &Entry,
        measurement: &Measurement<3, Self::Evidence>,
        updates_offsets: bool,
    ) -> Updated<3> {
        let (estimate, state_deviation) = &measurement.evidence;
        let std = step_deviation(past, estimate.state, *state_deviation);
        self.estimation.prediction.update(past, estimate, std);
        if !updates_offsets {
            return Updated::NOTHING;
        }
        let (triggers, raised) =
            self.update_offsets(past.command, estimate.state, estimate.observable);
        Updated { triggers, raised }
    }

    fn miss(&mut self, past: &Entry) {
        self.estimation.prediction.miss(past);
    }

    fn reset_prediction(&mut self, past: &Entry) {
        self.estimation.prediction.reset(past);
    }
}

impl BandBlocks for Paper {
    fn new(settings: &Settings, limits: PerDof<PlayLimit>) -> Result<Self, ConfigError> {
        let dofs = settings.dofs();
        let estimation = StateFromImages {
            estimator: state_estimator(&dofs)?,
            prediction: StatePrediction::new(dofs.map(|dof| dof.start_deviation))?,
            coupled_std: dofs.map(|dof| COUPLED * dof.start_deviation),
        };
        Self::with_estimation(&dofs, limits, estimation)
    }

    fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(&self, _: &History<S>, past: &Entry) -> Belief {
        self.estimation.prediction.at(past)
    }

    /// One linear step from the prediction, Eqs. (13)-(16). With one band the step starts from the state prediction of the
    /// last images, because the DOFs that are held keep its error.
    fn measure(
        &self,
        model: &FeatureModel,
        past: &Entry,
        image: Image<'_>,
    ) -> Option<Seen<Self::Evidence>> {
        let used = found(image.features);
        let prior = self.estimation.prediction.at(past);
        let start = if used == [true; 2] {
            past.predicted_state
        } else {
            prior.state
        };
        let prediction = model.predict(start)?;
        let estimate = self
            .estimation
            .estimator
            .estimate(start, &prediction, image.features);
        let state_deviation = estimate.state_deviation(image.covariance.unwrap_or(&UNIT));
        let (is_partial, has_outlier) = completeness(used, image.features);
        let measurement = Measurement {
            state: estimate.state,
            observable: estimate.observable,
            distance: self.estimation.distance(
                &prior,
                &estimate,
                step_deviation(past, prior.state, state_deviation),
            ),
            is_partial,
            has_outlier,
            evidence: (estimate, state_deviation),
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
    ) -> ([Triggers; N], Flags) {
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

impl StateFromImages {
    /// Largest innovation of a DOF, measured less predicted state, in standard deviations of prediction and measurement
    /// together, and of what the error of another DOF makes of a linear step.
    fn distance(&self, prior: &Belief, estimate: &StateEstimate, std: PerDof<f64>) -> f64 {
        let innovations = estimate.state.into_iter().zip(prior.state);
        let stds = std.into_iter().zip(prior.deviation).zip(self.coupled_std);
        innovations
            .zip(stds)
            .zip(estimate.observable)
            .filter(|(_, observable)| *observable)
            .map(|(((state, predicted), ((own, prior), coupled)), _)| {
                let variance = own * own + prior * prior + coupled * coupled;
                (state - predicted).abs() / libm::sqrt(variance)
            })
            .filter(|distance| distance.is_finite())
            .fold(0.0, f64::max)
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
