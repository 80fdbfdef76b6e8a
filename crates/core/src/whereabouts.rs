//! Where the instrument is, to the best of the loop's knowledge: for looking, not for learning.

use crate::dof::PerDof;
use crate::error::{ConfigError, require_positive};
use crate::history::Entry;
use crate::linear::square;
use crate::posture::Belief;
use crate::state::StateEstimate;

/// One linear step from far away misses by a part of itself.
const STEP_ERROR: f64 = 0.25;

/// What the last images said, per DOF, and how it has aged.
///
/// ```text
/// state = q + (q_hat - q)_last
/// deviation^2 = deviation_last^2 + (travel - travel_last)^2,  at most start_deviation^2
/// ```
///
/// with the travel of the command, forth and back: whatever the slack does, the tip has moved no
/// farther than the command. `deviation_last` has the image's own and a quarter of the correction, which was
/// one linear step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whereabouts {
    start_deviation: PerDof<f64>,
    correction: PerDof<f64>,
    /// At the last image that determined the DOF.
    deviation: PerDof<f64>,
    travel: PerDof<f64>,
}

impl Whereabouts {
    /// Before the first image: at the prediction, with these standard deviations (3,) [m, rad, rad].
    ///
    /// # Errors
    /// A value is not a finite number above 0.
    pub fn new(start_deviation: PerDof<f64>) -> Result<Self, ConfigError> {
        for value in start_deviation {
            require_positive("start_deviation", value)?;
        }
        Ok(Self {
            start_deviation,
            correction: [0.0; 3],
            deviation: start_deviation,
            travel: [0.0; 3],
        })
    }

    /// What is believed of the state at a moment of the history.
    pub(crate) fn at(&self, past: &Entry) -> Belief {
        let mut belief = Belief {
            state: past.predicted_state,
            deviation: self.start_deviation,
        };
        let known = self.correction.iter().zip(self.deviation).zip(self.travel);
        let now = belief
            .state
            .iter_mut()
            .zip(&mut belief.deviation)
            .zip(past.travel);
        for (((state, deviation), travel), ((correction, last), travel_last)) in now.zip(known) {
            *state += correction;
            let moved = (travel - travel_last).abs();
            *deviation = deviation.min(libm::sqrt(square(last) + square(moved)));
        }
        belief
    }

    /// Takes in what an image determined.
    pub(crate) fn learn(&mut self, past: &Entry, estimate: &StateEstimate, deviation: PerDof<f64>) {
        let seen = estimate
            .observable
            .iter()
            .zip(estimate.state)
            .zip(deviation);
        let then = past.predicted_state.iter().zip(past.travel);
        let known = self
            .correction
            .iter_mut()
            .zip(&mut self.deviation)
            .zip(&mut self.travel);
        for (
            (((correction, last), travel_last), (predicted, travel)),
            ((observable, state), own),
        ) in known.zip(then).zip(seen)
        {
            if *observable && own.is_finite() {
                *correction = state - predicted;
                *last = libm::sqrt(square(own) + square(STEP_ERROR * *correction));
                *travel_last = travel;
            }
        }
    }
}
