//! The whole loop, Fig. 6.

use crate::axis::Axis;
use crate::dof::{PerDof, all_finite};
use crate::estimator::Triggers;
use crate::features::{FeatureModel, FeaturePrediction};
use crate::history::{Entry, History};
use crate::play::Play;
use crate::state::{StateEstimate, StateEstimator};

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Every DOF was measured.
    Ok,
    /// Some DOF could not be observed and was held.
    Held,
    /// The markers were not found.
    NoMarkers,
    /// Captured at a time the history does not reach.
    Stale,
    /// Captured no later than a frame already used.
    Duplicate,
}

/// What the loop made of a frame; NaN is what is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// What became of the frame.
    pub status: Status,
    /// q at the capture time [m, rad, rad].
    pub predicted_state: PerDof<f64>,
    /// h(q) in px.
    pub predicted_features: [f64; 4],
    /// `q_hat`, innovation and what could be observed.
    pub estimate: StateEstimate,
    /// Which offsets were updated, and why.
    pub triggers: PerDof<Triggers>,
    /// The offsets from now on [m, rad, rad].
    pub play: PerDof<Play>,
}

/// Image-based hysteresis reduction, Fig. 6: reference in, command out; images teach it the slack.
#[derive(Debug, Clone)]
pub struct HysteresisReduction {
    axes: PerDof<Axis>,
    feature_model: FeatureModel,
    state_estimator: StateEstimator,
    history: History,
    last_used: f64,
}

impl HysteresisReduction {
    /// The loop from its blocks.
    pub const fn new(
        axes: PerDof<Axis>,
        feature_model: FeatureModel,
        state_estimator: StateEstimator,
        history: History,
    ) -> Self {
        Self {
            axes,
            feature_model,
            state_estimator,
            history,
            last_used: f64::NEG_INFINITY,
        }
    }

    /// Control tick at `time` in s: reference (3,) in, command (3,) out [m, rad, rad].
    ///
    /// A reference that is not finite holds the command, which before the first reference is NaN.
    pub fn step(&mut self, reference: PerDof<f64>, time: f64) -> PerDof<f64> {
        if all_finite(reference) {
            for (axis, reference) in self.axes.iter_mut().zip(reference) {
                axis.step(reference);
            }
        }
        let command = self.axes.each_ref().map(Axis::command);
        let jumped_back = self.history.push(Entry {
            time,
            command,
            predicted_state: self.predicted_state(),
        });
        if jumped_back {
            self.last_used = f64::NEG_INFINITY;
        }
        command
    }

    /// Image update: the features (4,) in px measured in a frame captured at `captured_at` in s.
    ///
    /// None, or features that are not finite, say that the markers were not found.
    pub fn on_features(&mut self, measured: Option<[f64; 4]>, captured_at: f64) -> Report {
        if captured_at <= self.last_used {
            return self.unused(Status::Duplicate, None);
        }
        let Some(past) = self.history.at(captured_at) else {
            return self.unused(Status::Stale, None);
        };
        let Some(measured) = measured.filter(|features| all_finite(*features)) else {
            return self.unused(Status::NoMarkers, Some(past));
        };
        let Some(prediction) = self.feature_model.predict(past.predicted_state) else {
            return self.unused(Status::Held, Some(past));
        };
        self.last_used = captured_at;
        self.learn(&past, &prediction, measured)
    }

    fn learn(
        &mut self,
        past: &Entry,
        prediction: &FeaturePrediction,
        measured: [f64; 4],
    ) -> Report {
        let estimate = self
            .state_estimator
            .estimate(past.predicted_state, prediction, measured);
        let mut triggers = [Triggers::default(); 3];
        let history = &self.history;
        let signals = estimate
            .observable
            .iter()
            .zip(past.command)
            .zip(estimate.state)
            .zip(estimate.deviation);
        let axes = self.axes.iter_mut().zip(&mut triggers).enumerate();
        for ((dof, (axis, triggers)), (((observable, command), measured), deviation)) in
            axes.zip(signals)
        {
            if *observable {
                let since = history
                    .since(past.time)
                    .filter_map(|entry| entry.command.get(dof).copied());
                *triggers = axis.learn(command, measured, deviation, since);
            }
        }
        let complete = estimate.observable.iter().all(|observable| *observable);
        Report {
            status: if complete { Status::Ok } else { Status::Held },
            predicted_state: past.predicted_state,
            predicted_features: prediction.features,
            estimate,
            triggers,
            play: self.play(),
        }
    }

    /// The report on a frame that taught nothing.
    fn unused(&self, status: Status, past: Option<Entry>) -> Report {
        let predicted_state = past.map_or([f64::NAN; 3], |past| past.predicted_state);
        let prediction = self.feature_model.predict(predicted_state);
        Report {
            status,
            predicted_state,
            predicted_features: prediction.map_or([f64::NAN; 4], |prediction| prediction.features),
            estimate: StateEstimate {
                state: predicted_state,
                observable: [false; 3],
                deviation: [f64::NAN; 3],
                innovation: [f64::NAN; 4],
            },
            triggers: [Triggers::default(); 3],
            play: self.play(),
        }
    }

    /// The features (4,) in px to expect in a frame captured at `captured_at` in s, to look there.
    ///
    /// None beyond the history and where a band cannot be seen.
    pub fn predicted_features(&self, captured_at: f64) -> Option<[f64; 4]> {
        let past = self.history.at(captured_at)?;
        let prediction = self.feature_model.predict(past.predicted_state)?;
        Some(prediction.features)
    }

    /// The predicted state q now [m, rad, rad]; NaN before the first reference.
    pub fn predicted_state(&self) -> PerDof<f64> {
        self.axes.each_ref().map(Axis::predicted_state)
    }

    /// The estimated play of each DOF now.
    pub fn play(&self) -> PerDof<Play> {
        self.axes.each_ref().map(Axis::play)
    }
}
