//! The whole loop, Fig. 6.

mod lesson;
mod look;
mod report;

use self::look::{Seen, reversed, usable};
pub use self::report::{Report, Status};
use crate::adaptive::friction::Friction;
use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::state::{StateEstimator, found};
use crate::dof::PerDof;
use crate::estimation::posture::Belief;
use crate::estimation::weighted::WeightedEstimator;
use crate::estimation::whereabouts::Whereabouts;
use crate::r#loop::axis::Axis;
use crate::r#loop::history::{Entry, History};
use crate::model::features::FeatureModel;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::frame_gate::{FrameArrival, ImageIdentity};
use crate::supervision::monitors::Monitors;

/// How an image becomes a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StateEstimation {
    /// The article's one linear step from the prediction, Eqs. (13)-(16).
    Article(StateEstimator),
    /// From what the last images said; profile `best`.
    Weighted(WeightedEstimator),
}

/// Image-based hysteresis reduction, Fig. 6: reference in, command out; images teach it the slack.
#[derive(Debug, Clone)]
pub struct HysteresisReduction {
    axes: PerDof<Axis>,
    friction: Option<Friction>,
    feature_model: FeatureModel,
    state_estimation: StateEstimation,
    history: History,
    whereabouts: Whereabouts,
    monitors: Monitors,
    travel: PerDof<f64>,
    corrected: PerDof<f64>,
    last_used: f64,
}

impl HysteresisReduction {
    /// The loop from its blocks.
    pub fn new(
        mut axes: PerDof<Axis>,
        feature_model: FeatureModel,
        state_estimation: StateEstimation,
        history: History,
        whereabouts: Whereabouts,
        monitors: Monitors,
    ) -> Self {
        monitors.limit(&mut axes);
        Self {
            axes,
            friction: None,
            feature_model,
            state_estimation,
            history,
            whereabouts,
            monitors,
            travel: [0.0; 3],
            corrected: [0.0; 3],
            last_used: f64::NEG_INFINITY,
        }
    }

    /// The same, for a shaft whose insertion and rotation share one friction.
    #[must_use]
    pub const fn with_friction(self, friction: Option<Friction>) -> Self {
        Self { friction, ..self }
    }

    /// Control tick at `time` in s: reference (3,) in, command (3,) out [m, rad, rad].
    ///
    /// `stamp` in s is when the reference was made, if that is known. A reference that is not finite
    /// holds the command, which before the first reference is NaN.
    pub fn step(&mut self, reference: PerDof<f64>, stamp: Option<f64>, time: f64) -> PerDof<f64> {
        let before = self.axes.each_ref().map(Axis::command);
        let believed = self.predicted_state();
        self.monitors.tick(&mut self.axes, reference, stamp, time);
        let command = self.axes.each_ref().map(Axis::command);
        let mut moved = distance(before, command);
        if let Some(friction) = &mut self.friction {
            friction.couple(self.monitors.admitted(), &mut self.axes);
            // What another DOF takes of the friction lets go of a tip whose command rests.
            let released = distance(believed, self.predicted_state());
            for (moved, released) in moved.iter_mut().zip(released) {
                *moved = moved.max(released);
            }
        }
        for (travel, moved) in self.travel.iter_mut().zip(moved) {
            *travel += if moved.is_finite() { moved } else { 0.0 };
        }
        let jumped_back = self.history.push(Entry {
            time,
            reference: self.monitors.admitted(),
            command,
            predicted_state: self.predicted_state(),
            corrected: self.corrected,
            travel: self.travel,
        });
        if jumped_back {
            self.last_used = f64::NEG_INFINITY;
        }
        command
    }

    /// Image update: the features (4,) in px measured in a frame captured at `captured_at` in s, and their
    /// covariance (4, 4) in px^2; None is 1 px^2 for each, or what the
    /// weighted estimation is set to.
    ///
    /// Two NaN for a band say that it was not found; None, or features that are not finite
    /// otherwise, that neither was. With one band the article's step too starts from `expectation` and not
    /// from the prediction: what is held must be as right as is known. A `checksum` of the pixels tells a
    /// frozen picture; without it, equal features do.
    pub fn on_features(
        &mut self,
        measured: Option<[f64; 4]>,
        covariance: Option<&[[f64; 4]; 4]>,
        captured_at: f64,
        checksum: Option<u64>,
    ) -> Report {
        let past = self.history.at(captured_at);
        let mut raised = self.monitors.arrive(&FrameArrival {
            captured_at,
            now: self.history.newest_time(),
            image: checksum.map_or_else(
                || measured.map(|features| ImageIdentity::Features(features.map(f64::to_bits))),
                |sum| Some(ImageIdentity::Checksum(sum)),
            ),
            travel: past.map(|past| past.travel),
        });
        let mut report = self.image_update(measured, covariance, captured_at, past, &mut raised);
        self.monitors.judged(raised);
        report.supervision = self.monitors.supervision();
        report
    }

    /// The image update of a frame of which monitors have said what is wrong so far.
    fn image_update(
        &mut self,
        measured: Option<[f64; 4]>,
        covariance: Option<&[[f64; 4]; 4]>,
        captured_at: f64,
        past: Option<Entry>,
        raised: &mut Flags,
    ) -> Report {
        if captured_at <= self.last_used {
            *raised = self
                .monitors
                .watched(raised.union(Flags::of(Flag::Duplicate)));
            return self.unused(Status::Duplicate, None);
        }
        let Some(past) = past else {
            return self.unused(Status::Stale, None);
        };
        if !raised.is_empty() {
            return self.unused(Status::Refused, Some(past));
        }
        let Some(measured) = measured.filter(|features| usable(*features)) else {
            self.whereabouts.miss(&past);
            self.monitors.frames.miss(past.travel);
            *raised = self.monitors.watched(Flags::of(Flag::Lost));
            return self.unused(Status::NoMarkers, Some(past));
        };
        let Some(seen) = self.look(&past, measured, covariance) else {
            return self.unused(Status::Held, Some(past));
        };
        let belief = self.whereabouts.at(&past);
        let moved = self.whereabouts.moved(&past);
        // The article's estimate jumps by itself wherever a DOF begins or ceases to be held.
        let unasked = match self.state_estimation {
            StateEstimation::Article(_) => Flags::of(Flag::Jump).union(Flags::of(Flag::Slip)),
            StateEstimation::Weighted(_) => Flags::NONE,
        };
        let offsets = self.axes.each_ref().map(Axis::offsets);
        let doubts = |seen: &Seen| {
            let sightings = seen.sightings(&past, offsets);
            let frames = &self.monitors.frames;
            frames
                .check_innovation(&belief, moved, &sightings)
                .difference(unasked)
        };
        let doubt = doubts(&seen);
        let is_believed = seen.used != [false; 2];
        let expected = self.feature_model.predict(belief.state);
        let is_reversed = expected.is_some_and(|expected| reversed(expected.features, measured));
        if is_reversed || !is_believed || !doubt.is_empty() {
            let [ua, va, ub, vb] = measured;
            let exchanged = self.look(&past, [ub, vb, ua, va], covariance);
            let swapped = is_reversed
                || exchanged
                    .is_some_and(|other| other.used == [true; 2] && doubts(&other).is_empty());
            *raised = self.monitors.watched(Flags::when(swapped, Flag::Swapped));
            if raised.is_empty() && is_believed {
                *raised = self.monitors.watched(doubt);
            }
            if !raised.is_empty() {
                self.whereabouts.miss(&past);
                return self.unused(Status::Refused, Some(past));
            }
        }
        self.monitors
            .frames
            .accept(&belief, &seen.sightings(&past, offsets));
        self.last_used = captured_at;
        self.settle(&past, &seen, measured);
        let estimate = seen.estimate;
        let status = match (seen.used, estimate.observable) {
            ([true, false] | [false, true], _) => Status::Partial,
            ([true, true], [true, true, true]) => Status::Ok,
            _ => Status::Held,
        };
        // Two markers of which one is where it cannot be: the other may be as wrong.
        let is_doubtful = is_believed && seen.used != found(measured);
        let left_out = self
            .monitors
            .watched(Flags::when(is_doubtful, Flag::Innovation));
        let triggers = if left_out.is_empty() && self.monitors.may_learn() {
            self.learn(&past, &seen, raised)
        } else {
            [Triggers::default(); 3]
        };
        *raised = self.monitors.watched(
            raised
                .union(Flags::when(status == Status::Partial, Flag::Merged))
                .union(Flags::when(!is_believed, Flag::Lost))
                .union(Flags::when(
                    is_believed && status == Status::Held,
                    Flag::Unobservable,
                )),
        );
        Report {
            status,
            predicted_state: past.predicted_state,
            predicted_features: seen.predicted_features,
            triggers,
            estimate,
            state_deviation: seen.state_deviation,
            play: self.play(),
            supervision: self.monitors.supervision(),
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

    /// Where the instrument should be in a frame captured at `captured_at` in s, and how sure that
    /// is: the prediction and what the last images corrected it by. It says where to look, and to the weighted
    /// estimation where to start.
    ///
    /// None beyond the history.
    pub fn expectation(&self, captured_at: f64) -> Option<Belief> {
        Some(self.whereabouts.at(&self.history.at(captured_at)?))
    }

    /// The predicted state q now [m, rad, rad]; NaN before the first reference.
    pub fn predicted_state(&self) -> PerDof<f64> {
        self.axes.each_ref().map(Axis::predicted_state)
    }

    /// The estimated play of each DOF now.
    pub fn play(&self) -> PerDof<Play> {
        self.axes.each_ref().map(Axis::play)
    }

    /// What watches the loop.
    pub const fn monitors(&self) -> &Monitors {
        &self.monitors
    }

    /// What watches the loop, to re-engage, to acknowledge, and to raise what only the rig can see.
    pub const fn monitors_mut(&mut self) -> &mut Monitors {
        &mut self.monitors
    }
}

fn distance(from: PerDof<f64>, to: PerDof<f64>) -> PerDof<f64> {
    let [a, b, c] = from;
    let [d, e, f] = to;
    [(d - a).abs(), (e - b).abs(), (f - c).abs()]
}
