//! Profile `paper`: the article's compensator, estimator and state estimation, Eqs. (2)-(6) and (13)-(16).

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::estimator::{Estimator, EstimatorState};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::article::state::{StateEstimator, found};
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::history::Entry;
use crate::estimation::whereabouts::{Whereabouts, WhereaboutsSettings};
use crate::r#loop::axis::{Axis, OffsetUpdate};
use crate::r#loop::measurement::Measurement;
use crate::r#loop::profile::ProfileBlocks;
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

/// Profile `paper`.
#[derive(Debug, Clone, PartialEq)]
pub struct Paper {
    axes: PerDof<ArticleAxis>,
    state_estimator: StateEstimator,
}

impl ProfileBlocks for Paper {
    type Axis = ArticleAxis;

    /// The estimate jumps where a DOF begins or ceases to be held.
    const UNCHECKED: Flags = Flags::of(Flag::Jump).union(Flags::of(Flag::Slip));

    fn new(settings: &Settings) -> Result<Self, ConfigError> {
        let [insertion, rotation, bending] = settings.dofs();
        Ok(Self {
            axes: [
                ArticleAxis::new(&insertion)?,
                ArticleAxis::new(&rotation)?,
                ArticleAxis::new(&bending)?,
            ],
            state_estimator: state_estimator(settings)?,
        })
    }

    fn whereabouts(settings: &Settings) -> Result<Whereabouts, ConfigError> {
        Whereabouts::new(WhereaboutsSettings {
            start_deviation: settings.dofs().map(|dof| dof.start_deviation),
            rest_deviation: [0.0; 3],
            settling_time: 0.0,
        })
    }

    fn axes(&self) -> &PerDof<ArticleAxis> {
        &self.axes
    }

    fn axes_mut(&mut self) -> &mut PerDof<ArticleAxis> {
        &mut self.axes
    }

    fn couple(&mut self, _: PerDof<f64>) -> bool {
        false
    }

    /// One linear step from the prediction, Eqs. (13)-(16). With one band the step starts from the state prediction of the
    /// last images, because the DOFs that are held keep its error.
    fn measure(
        &self,
        model: &FeatureModel,
        whereabouts: &Whereabouts,
        past: &Entry,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Option<Measurement> {
        let used = found(measured);
        let start = if used == [true; 2] {
            past.predicted_state
        } else {
            whereabouts.at(past).state
        };
        let prediction = model.predict(start)?;
        let estimate = self.state_estimator.estimate(start, &prediction, measured);
        let state_deviation = estimate.state_deviation(covariance.unwrap_or(&UNIT));
        Some(Measurement {
            estimate,
            used,
            predicted_features: prediction.features,
            state_deviation,
            output: estimate.state,
            output_deviation: state_deviation,
        })
    }

    fn update_prediction(
        &self,
        whereabouts: &mut Whereabouts,
        past: &Entry,
        measurement: &Measurement,
        _: [f64; 4],
    ) {
        whereabouts.learn(past, &measurement.estimate, measurement.state_deviation);
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
    /// One DOF from its settings.
    ///
    /// # Errors
    /// As [`Compensator::new`], [`Compensator::with_recovery`], [`Estimator::new`] and [`Play::new`].
    pub fn new(dof: &DofSettings) -> Result<Self, ConfigError> {
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
}

impl Law for ArticleAxis {
    fn command(&self) -> f64 {
        self.compensation.command()
    }

    fn step_within(&mut self, reference: f64, limit: impl FnOnce(f64) -> f64) {
        self.compensator
            .step_within(&mut self.compensation, reference, limit);
    }

    fn shift_reference(&mut self, shift: f64) {
        self.compensator
            .shift_reference(&mut self.compensation, shift);
    }

    fn set_share(&mut self, share: f64) {
        self.compensator = self.configured.with_share(share);
        let play = self.compensation.play();
        self.compensator.retune(&mut self.compensation, play);
    }
}

impl Axis for ArticleAxis {
    fn predicted_state(&self) -> f64 {
        self.compensation.predicted_state()
    }

    fn play(&self) -> Play {
        self.estimation.play()
    }

    fn offsets(&self) -> (f64, f64) {
        (f64::NEG_INFINITY, f64::INFINITY)
    }

    fn set_limit(&mut self, limit: PlayLimit) {
        self.limit = limit;
    }

    fn play_limit(&self) -> PlayLimit {
        self.limit
    }

    fn update_offsets(
        &mut self,
        command: f64,
        measured: f64,
        _: f64,
        _: impl Iterator<Item = f64>,
    ) -> OffsetUpdate {
        let triggers = self
            .estimator
            .update(&mut self.estimation, command, measured);
        let is_limited = self.estimation.limit(self.limit);
        if triggers.any() {
            self.compensator
                .retune(&mut self.compensation, self.estimation.play());
        }
        OffsetUpdate {
            triggers,
            is_limited,
            change: [0.0; 2],
        }
    }
}
