//! One DOF of the loop: how its slack is compensated and learnt.

use crate::adaptive::AdaptiveAxis;
use crate::compensator::{Compensator, CompensatorState};
use crate::estimator::{Estimator, EstimatorState, Triggers};
use crate::play::Play;

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
    compensator: Compensator,
    estimator: Estimator,
    compensation: CompensatorState,
    estimation: EstimatorState,
}

impl Axis {
    /// A DOF that works as in the article and starts from the offsets of `play`.
    pub const fn new(compensator: Compensator, estimator: Estimator, play: Play) -> Self {
        Self::Article(ArticleAxis {
            compensator,
            estimator,
            compensation: CompensatorState::new(play),
            estimation: EstimatorState::new(play),
        })
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
    ) -> Triggers {
        match self {
            Self::Article(axis) => axis.learn(command, measured),
            Self::Adaptive(axis) => axis.learn(command, measured, deviation, since),
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

    /// The play operator believed in, where the DOF is now.
    pub(crate) fn play(&self) -> Play {
        match self {
            Self::Article(axis) => axis.estimation.play(),
            Self::Adaptive(axis) => axis.play(),
        }
    }
}

impl ArticleAxis {
    fn learn(&mut self, command: f64, measured: f64) -> Triggers {
        let triggers = self
            .estimator
            .update(&mut self.estimation, command, measured);
        if triggers.any() {
            self.compensator
                .retune(&mut self.compensation, self.estimation.play());
        }
        triggers
    }
}
