//! One DOF of the loop: how its slack is compensated and learnt.

use crate::adaptive::axis::AdaptiveAxis;
use crate::adaptive::friction::SlackShare;
use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::estimator::{Estimator, EstimatorState, Triggers};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;

/// One DOF of the loop, each scheme with its memory.
#[derive(Debug, Clone, PartialEq)]
// Without an allocator nothing can be boxed, and there are three of them.
#[allow(clippy::large_enum_variant)]
pub enum Axis {
    /// The article's compensator and estimator, Eqs. (2)-(6).
    Article(ArticleAxis),
    /// Profile `best`.
    Adaptive(AdaptiveAxis),
}

/// The article's compensator and estimator, each with its memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArticleAxis {
    /// As set, and with the share of its free gain in use.
    whole: Compensator,
    compensator: Compensator,
    estimator: Estimator,
    compensation: CompensatorState,
    estimation: EstimatorState,
    limit: PlayLimit,
}

/// What an image taught.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Lesson {
    /// Which offsets were updated, and why.
    pub triggers: Triggers,
    /// Whether it would have been more slack than may be.
    pub is_limited: bool,
    /// What it changed of (`delta_minus`, `delta_plus`) where the DOF is; 0 in profile `paper`, where any one image
    /// may change all.
    pub change: [f64; 2],
}

impl Axis {
    /// A DOF that works as in the article and starts from the offsets of `play`.
    pub const fn new(compensator: Compensator, estimator: Estimator, play: Play) -> Self {
        Self::Article(ArticleAxis {
            whole: compensator,
            compensator,
            estimator,
            compensation: CompensatorState::new(play),
            estimation: EstimatorState::new(play),
            limit: PlayLimit::NONE,
        })
    }

    /// Believe in no more slack than that.
    pub(crate) const fn limit(&mut self, limit: PlayLimit) {
        match self {
            Self::Article(axis) => axis.limit = limit,
            Self::Adaptive(axis) => axis.limit(limit),
        }
    }

    /// Half the width of the slack by itself; none in the article's scheme.
    pub(crate) fn half_width(&self) -> f64 {
        match self {
            Self::Article(_) => 0.0,
            Self::Adaptive(axis) => axis.half_width(),
        }
    }

    /// How much of its friction is shared, 0 to 1; the article's scheme does not know of that.
    pub(crate) fn shared(&self) -> f64 {
        match self {
            Self::Article(_) => 0.0,
            Self::Adaptive(axis) => axis.shared(),
        }
    }

    /// So much of its slack is left for it if all friction is shared; the other DOF shares so much of its own.
    pub(crate) fn set_slack_share(&mut self, part: SlackShare, of_other: f64) {
        if let Self::Adaptive(axis) = self {
            axis.set_slack_share(part, of_other);
        }
    }

    /// Use a share of the free gain: all of it with 1, no compensation with 0. Bumpless.
    pub(crate) fn set_share(&mut self, share: f64) {
        match self {
            Self::Article(axis) => axis.set_share(share),
            Self::Adaptive(axis) => axis.set_share(share),
        }
    }

    /// Go on from another command than that of the last step, with the reference counted from elsewhere by `shift`, and
    /// the predicted state from before that step.
    pub(crate) fn amend(&mut self, shift: f64, command: f64, predicted_state: f64) {
        match self {
            Self::Article(axis) => {
                axis.compensator
                    .amend(&mut axis.compensation, shift, command, predicted_state);
            }
            Self::Adaptive(axis) => axis.amend(shift, command, predicted_state),
        }
    }

    /// Control tick: take the next reference.
    pub(crate) fn step(&mut self, reference: f64) {
        match self {
            Self::Article(axis) => {
                axis.compensator.step(&mut axis.compensation, reference);
            }
            Self::Adaptive(axis) => {
                axis.step(reference);
            }
        }
    }

    /// Learn from command and output of one instant, the output's standard deviation, and the
    /// commands since, oldest first.
    pub(crate) fn learn(
        &mut self,
        command: f64,
        measured: f64,
        deviation: f64,
        since: impl Iterator<Item = f64>,
    ) -> Lesson {
        let limit = match self {
            Self::Article(axis) => axis.limit,
            Self::Adaptive(axis) => axis.play_limit(),
        };
        if !limit.allows(command - measured) {
            return Lesson {
                is_limited: true,
                ..Lesson::default()
            };
        }
        match self {
            Self::Article(axis) => axis.learn(command, measured),
            Self::Adaptive(axis) => {
                let before = axis.play();
                let triggers = axis.learn(command, measured, deviation, since);
                let after = axis.play();
                Lesson {
                    triggers,
                    is_limited: axis.is_limited(),
                    change: [
                        after.delta_minus() - before.delta_minus(),
                        after.delta_plus() - before.delta_plus(),
                    ],
                }
            }
        }
    }

    pub(crate) const fn command(&self) -> f64 {
        match self {
            Self::Article(axis) => axis.compensation.command(),
            Self::Adaptive(axis) => axis.command(),
        }
    }

    pub(crate) const fn predicted_state(&self) -> f64 {
        match self {
            Self::Article(axis) => axis.compensation.predicted_state(),
            Self::Adaptive(axis) => axis.predicted_state(),
        }
    }

    /// Least and largest offset that the slack as learnt allows, where the DOF is now.
    pub(crate) fn offsets(&self) -> (f64, f64) {
        match self {
            Self::Article(_) => (f64::NEG_INFINITY, f64::INFINITY),
            Self::Adaptive(axis) => axis.offsets(),
        }
    }

    /// The play operator believed in, where the DOF is now.
    pub(crate) fn play(&self) -> Play {
        match self {
            Self::Article(axis) => axis.estimation.play(),
            Self::Adaptive(axis) => axis.play(),
        }
    }
}

impl ArticleAxis {
    fn learn(&mut self, command: f64, measured: f64) -> Lesson {
        let triggers = self
            .estimator
            .update(&mut self.estimation, command, measured);
        let is_limited = self.estimation.limit(self.limit);
        if triggers.any() {
            self.compensator
                .retune(&mut self.compensation, self.estimation.play());
        }
        Lesson {
            triggers,
            is_limited,
            change: [0.0; 2],
        }
    }

    fn set_share(&mut self, share: f64) {
        self.compensator = self.whole.with_share(share);
        let play = self.compensation.play();
        self.compensator.retune(&mut self.compensation, play);
    }
}
