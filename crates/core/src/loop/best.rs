//! Profile `best`: lead law, offsets over position, shared friction, weighted state estimation.

use crate::adaptive::axis::AdaptiveAxis;
use crate::adaptive::friction::Friction;
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::article::state::{StateEstimate, found};
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::history::Entry;
use crate::estimation::posture::{half_turn, turn};
use crate::estimation::weighted::WeightedEstimator;
use crate::estimation::whereabouts::{Whereabouts, WhereaboutsSettings};
use crate::r#loop::axis::{Axis, OffsetUpdate};
use crate::r#loop::measurement::Measurement;
use crate::r#loop::paper::state_estimator;
use crate::r#loop::profile::ProfileBlocks;
use crate::r#loop::settings::Settings;
use crate::model::features::FeatureModel;
use crate::supervision::flags::Flags;
use crate::supervision::monitors::Law;

/// Profile `best`.
#[derive(Debug, Clone, PartialEq)]
pub struct Best {
    axes: PerDof<AdaptiveAxis>,
    friction: Option<Friction>,
    state_estimator: WeightedEstimator,
}

impl ProfileBlocks for Best {
    type Axis = AdaptiveAxis;

    const UNCHECKED: Flags = Flags::NONE;

    // Without an allocator the axes are on the stack.
    #[allow(clippy::large_stack_arrays)]
    fn new(settings: &Settings) -> Result<Self, ConfigError> {
        let diameter = settings.instrument.diameter;
        let friction = settings.adaptive.friction(&settings.insertion, diameter);
        Ok(Self {
            axes: [
                AdaptiveAxis::from_settings(settings, 0)?,
                AdaptiveAxis::from_settings(settings, 1)?,
                AdaptiveAxis::from_settings(settings, 2)?,
            ],
            friction: friction.map(Friction::new).transpose()?,
            state_estimator: WeightedEstimator::from_settings(settings)?,
        })
    }

    fn whereabouts(settings: &Settings) -> Result<Whereabouts, ConfigError> {
        let rest = settings.state_estimation.rest_deviation;
        Whereabouts::new(WhereaboutsSettings {
            start_deviation: settings.dofs().map(|dof| dof.start_deviation),
            rest_deviation: settings.dofs().map(|dof| dof.update_distance * rest),
            settling_time: settings.state_estimation.settling_time,
        })
    }

    fn axes(&self) -> &PerDof<AdaptiveAxis> {
        &self.axes
    }

    fn axes_mut(&mut self) -> &mut PerDof<AdaptiveAxis> {
        &mut self.axes
    }

    fn couple(&mut self, [u1, u2, _]: PerDof<f64>) -> bool {
        let Some(friction) = &mut self.friction else {
            return false;
        };
        let [insertion, rotation, _] = &mut self.axes;
        let [first, second] = friction.step(
            [u1, u2],
            [insertion.command(), rotation.command()],
            [insertion.half_width(), rotation.half_width()],
        );
        let shared = [insertion.shared(), rotation.shared()];
        insertion.set_slack_share(first, shared[1]);
        rotation.set_slack_share(second, shared[0]);
        true
    }

    fn measure(
        &self,
        model: &FeatureModel,
        whereabouts: &Whereabouts,
        past: &Entry,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Option<Measurement> {
        let prior = whereabouts.at(past);
        let posterior = self
            .state_estimator
            .estimate(model, &prior, measured, covariance)?;
        let half_turn = half_turn(prior.state, posterior.estimate.state);
        Some(Measurement {
            estimate: StateEstimate {
                state: turn(posterior.estimate.state, half_turn),
                ..posterior.estimate
            },
            used: posterior.used,
            predicted_features: posterior.predicted_features,
            state_deviation: posterior.deviation,
            output: turn(posterior.image_state, half_turn),
            output_deviation: posterior.image_deviation,
        })
    }

    fn update_prediction(
        &self,
        whereabouts: &mut Whereabouts,
        past: &Entry,
        measurement: &Measurement,
        measured: [f64; 4],
    ) {
        let left_out = measurement.used != found(measured);
        let state = measurement.estimate.state;
        whereabouts.settle(past, state, measurement.state_deviation, left_out);
    }
}

impl WeightedEstimator {
    /// The state estimation of a configured loop.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn from_settings(settings: &Settings) -> Result<Self, ConfigError> {
        Self::new(state_estimator(settings)?, settings.state_estimation)
    }
}

impl AdaptiveAxis {
    /// DOF number `index` of a configured loop.
    ///
    /// # Errors
    /// A setting is out of range, or `index` is above 2.
    pub fn from_settings(settings: &Settings, index: usize) -> Result<Self, ConfigError> {
        let (dofs, rates) = (settings.dofs(), settings.adaptive.change_rate);
        let (Some(dof), Some(change_rate)) = (dofs.get(index), rates.get(index)) else {
            return Err(ConfigError {
                field: "dof",
                value: f64::NAN,
                allowed: "0, 1 or 2",
            });
        };
        let parameters = settings
            .adaptive
            .parameters(dof, *change_rate, &settings.control);
        Self::new(parameters, Play::new(dof.delta_minus, dof.delta_plus)?)
    }
}

impl Law for AdaptiveAxis {
    fn command(&self) -> f64 {
        self.command()
    }

    fn step_within(&mut self, reference: f64, limit: impl FnOnce(f64) -> f64) {
        self.step_within(reference, limit);
    }

    fn shift_reference(&mut self, shift: f64) {
        self.shift_reference(shift);
    }

    fn set_share(&mut self, share: f64) {
        self.set_share(share);
    }
}

impl Axis for AdaptiveAxis {
    fn predicted_state(&self) -> f64 {
        self.predicted_state()
    }

    fn play(&self) -> Play {
        self.play()
    }

    fn offsets(&self) -> (f64, f64) {
        self.offsets()
    }

    fn set_limit(&mut self, limit: PlayLimit) {
        self.limit(limit);
    }

    fn play_limit(&self) -> PlayLimit {
        self.play_limit()
    }

    fn update_offsets(
        &mut self,
        command: f64,
        measured: f64,
        deviation: f64,
        since: impl Iterator<Item = f64>,
    ) -> OffsetUpdate {
        let before = self.play();
        let triggers = self.learn(command, measured, deviation, since);
        let after = self.play();
        OffsetUpdate {
            triggers,
            is_limited: self.is_limited(),
            change: [
                after.delta_minus() - before.delta_minus(),
                after.delta_plus() - before.delta_plus(),
            ],
        }
    }
}
