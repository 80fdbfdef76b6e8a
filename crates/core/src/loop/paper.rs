//! Profile `paper`: the article's compensator, estimator and state estimation, Eqs. (2)-(6) and (13)-(16).

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::estimator::{Estimator, EstimatorState, Triggers};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::article::state::{StateEstimate, StateEstimator, found};
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::history::{Entry, History};
use crate::estimation::posture::Belief;
use crate::estimation::state_prediction::{StatePrediction, step_deviation};
use crate::r#loop::measurement::Measurement;
use crate::r#loop::profile::{Image, ImageUpdate, ProfileBlocks};
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

/// Profile `paper`.
#[derive(Debug, Clone, PartialEq)]
pub struct Paper {
    axes: PerDof<ArticleAxis>,
    state_estimator: StateEstimator,
    prediction: StatePrediction,
    corrected: PerDof<f64>,
    coupled_std: PerDof<f64>,
}

impl Law<3> for Paper {
    fn command(&self) -> PerDof<f64> {
        self.axes.each_ref().map(|axis| axis.compensation.command())
    }

    fn propose(&mut self, reference: PerDof<f64>) -> PerDof<f64> {
        let mut command = reference;
        for (axis, value) in self.axes.iter_mut().zip(&mut command) {
            *value = axis.compensator.propose(&mut axis.compensation, *value);
        }
        command
    }

    fn commit(&mut self, command: PerDof<f64>) {
        for (axis, command) in self.axes.iter_mut().zip(command) {
            axis.compensator.commit(&mut axis.compensation, command);
        }
    }

    fn shift_reference(&mut self, shift: PerDof<f64>) {
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

impl ProfileBlocks for Paper {
    const IS_COUPLED: bool = false;

    fn new(settings: &Settings, limits: PerDof<PlayLimit>) -> Result<Self, ConfigError> {
        let [insertion, rotation, bending] = settings.dofs();
        let [limit1, limit2, limit3] = limits;
        Ok(Self {
            axes: [
                ArticleAxis::new(&insertion, limit1)?,
                ArticleAxis::new(&rotation, limit2)?,
                ArticleAxis::new(&bending, limit3)?,
            ],
            state_estimator: state_estimator(settings)?,
            prediction: StatePrediction::new(settings.dofs().map(|dof| dof.start_deviation))?,
            corrected: [0.0; 3],
            coupled_std: settings.dofs().map(|dof| COUPLED * dof.start_deviation),
        })
    }

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

    fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(&self, _: &History<S>, past: &Entry) -> Belief {
        self.prediction.at(past)
    }

    fn advance<S: AsRef<[Entry]> + AsMut<[Entry]>>(&mut self, _: &History<S>, _: &Entry) {}

    /// One linear step from the prediction, Eqs. (13)-(16). With one band the step starts from the state prediction of the
    /// last images, because the DOFs that are held keep its error.
    fn measure(&self, model: &FeatureModel, past: &Entry, image: Image<'_>) -> Option<Measurement> {
        let used = found(image.features);
        let prior = self.prediction.at(past);
        let start = if used == [true; 2] {
            past.predicted_state
        } else {
            prior.state
        };
        let prediction = model.predict(start)?;
        let estimate = self
            .state_estimator
            .estimate(start, &prediction, image.features);
        let state_deviation = estimate.state_deviation(image.covariance.unwrap_or(&UNIT));
        Some(Measurement {
            estimate,
            used,
            predicted_features: prediction.features,
            state_deviation,
            distance: self.distance(
                &prior,
                &estimate,
                step_deviation(past, prior.state, state_deviation),
            ),
            markers: None,
            bands: None,
        })
    }

    fn update<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &mut self,
        _: &History<S>,
        past: &Entry,
        measurement: &Measurement,
        _: Image<'_>,
        updates_offsets: bool,
    ) -> ImageUpdate {
        let estimate = &measurement.estimate;
        let std = step_deviation(past, estimate.state, measurement.state_deviation);
        self.prediction.update(past, estimate, std);
        let mut update = ImageUpdate::default();
        if !updates_offsets {
            return update;
        }
        let signals = estimate
            .observable
            .iter()
            .zip(past.command)
            .zip(estimate.state);
        let axes = self.axes.iter_mut().zip(&mut self.corrected);
        for ((axis, corrected), (triggers, ((observable, command), output))) in
            axes.zip(update.triggers.iter_mut().zip(signals))
        {
            if !observable {
                continue;
            }
            let before = axis.compensation.predicted_state();
            let is_limited;
            (*triggers, is_limited) = axis.update_offsets(command, output);
            let limited = Flags::when(is_limited, Flag::WidthLimit);
            update.raised = update.raised.union(limited);
            let moved = axis.compensation.predicted_state() - before;
            *corrected += if moved.is_finite() { moved } else { 0.0 };
        }
        update
    }

    fn miss(&mut self, past: &Entry) {
        self.prediction.miss(past);
    }

    fn reset_prediction(&mut self, past: &Entry) {
        self.prediction.reset(past);
    }
}

impl Paper {
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
pub fn state_estimator(settings: &Settings) -> Result<StateEstimator, ConfigError> {
    StateEstimator::new(settings.dofs().map(|dof| dof.observable_deviation))
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
    /// One DOF from its settings, with the limit of its offsets.
    ///
    /// # Errors
    /// As [`Compensator::new`], [`Compensator::with_recovery`], [`Estimator::new`] and [`Play::new`].
    fn new(dof: &DofSettings, limit: PlayLimit) -> Result<Self, ConfigError> {
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
            limit,
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
