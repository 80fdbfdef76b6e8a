//! State prediction of profile `paper` for the marker detection.

use core::f64::consts::{FRAC_PI_2, PI};

use crate::article::state::StateEstimate;
use crate::dof::PerDof;
use crate::error::{ConfigError, require_positive};
use crate::estimation::expectation::Belief;
use crate::estimation::history::Entry;
use crate::math::linear::{add, square};

/// Error of one linear step, as a share of the step.
const STEP_ERROR: f64 = 0.25;
/// Growth of the standard deviation by an image without markers, and its limit in `start_deviation`: beyond it, a bend in
/// the opposite direction, half a turn on, would be found as well.
const MISS: f64 = 1.5;
const MISSED: f64 = 0.15;

/// State predicted from the last images, of each DOF by itself.
///
/// ```text
/// state = q + (q_hat - q)_last - (what images have moved q by since)
/// deviation^2 = deviation_last^2 + (travel - travel_last)^2,  at most start_deviation^2
/// ```
///
/// with the travel of [`Entry`]: whatever the slack does, the tip moves no farther. `deviation_last` has the image's own
/// and, of the linear step of Eq. (16), a quarter of the correction. Every image without markers makes it half as large
/// again, up to a part of `start_deviation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatePrediction {
    start_deviation: PerDof<f64>,
    last: PerDof<Last>,
}

/// One DOF at the last image that determined it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Last {
    /// `q_hat - q`, and what images had moved q by when it was taken.
    correction: f64,
    deviation: f64,
    travel: f64,
}

/// Standard deviation of an estimate by one linear step from the predicted state to `state`, from that of the markers.
pub fn step_deviation(past: &Entry, state: PerDof<f64>, deviation: PerDof<f64>) -> PerDof<f64> {
    let mut own = deviation;
    let seen = state.into_iter().zip(past.predicted_state);
    for (own, (state, predicted)) in own.iter_mut().zip(seen) {
        *own = libm::sqrt(square(*own) + square(STEP_ERROR * (state - predicted)));
    }
    own
}

impl StatePrediction {
    /// Before the first image: at the prediction.
    ///
    /// # Errors
    /// A start deviation is not a finite number above 0.
    pub fn new(start_deviation: PerDof<f64>) -> Result<Self, ConfigError> {
        for start in start_deviation {
            require_positive("start_deviation", start)?;
        }
        let last = start_deviation.map(|deviation| Last {
            correction: 0.0,
            deviation,
            travel: 0.0,
        });
        Ok(Self {
            start_deviation,
            last,
        })
    }

    /// The prediction at a moment of the history.
    pub(crate) fn at(&self, past: &Entry) -> Belief {
        let mut belief = Belief {
            state: add(past.predicted_state, -1.0, past.corrected),
            deviation: self.start_deviation,
        };
        let now = belief.state.iter_mut().zip(&mut belief.deviation);
        for (((state, deviation), travel), last) in now.zip(past.travel).zip(self.last) {
            *state += last.correction;
            let moved = travel - last.travel;
            let variance = square(last.deviation) + square(moved);
            *deviation = deviation.min(libm::sqrt(variance));
        }
        belief.state = turn(belief.state, half_turn(past.predicted_state, belief.state));
        belief
    }

    /// Updates the prediction with an estimate by one linear step, with its standard deviation by [`step_deviation`].
    pub(crate) fn update(
        &mut self,
        past: &Entry,
        estimate: &StateEstimate,
        deviation: PerDof<f64>,
    ) {
        self.set(past, estimate.state, deviation, estimate.observable);
    }

    /// Makes the prediction less certain after an image without markers.
    pub(crate) fn miss(&mut self, past: &Entry) {
        let Belief { state, deviation } = self.at(past);
        let mut wider = deviation;
        for (deviation, start) in wider.iter_mut().zip(self.start_deviation) {
            *deviation = deviation.max((MISS * *deviation).min(MISSED * start));
        }
        self.set(past, state, wider, [true; 3]);
    }

    /// Makes the prediction as uncertain as at the start.
    pub(crate) fn reset(&mut self, past: &Entry) {
        let state = self.at(past).state;
        self.set(past, state, self.start_deviation, [true; 3]);
    }

    fn set(
        &mut self,
        past: &Entry,
        state: PerDof<f64>,
        deviation: PerDof<f64>,
        known: PerDof<bool>,
    ) {
        let correction = add(add(state, -1.0, past.predicted_state), 1.0, past.corrected);
        let new = correction.iter().zip(deviation).zip(past.travel);
        for ((last, known), ((correction, deviation), travel)) in
            self.last.iter_mut().zip(known).zip(new)
        {
            if known && deviation.is_finite() {
                *last = Last {
                    correction: *correction,
                    deviation,
                    travel,
                };
            }
        }
    }
}

/// By how much to [`turn`] a state, in rad, for the name of its posture that is nearer to an expected one; 0: not.
///
/// Wrong where the rotation is expected a quarter of a turn off.
fn half_turn(expected: PerDof<f64>, state: PerDof<f64>) -> f64 {
    let ([_, expected, _], [_, rotation, _]) = (expected, state);
    let away = rotation - expected;
    if away.abs() > FRAC_PI_2 {
        -PI.copysign(away)
    } else {
        0.0
    }
}

/// The same posture by another name, `half_turn` being pi, -pi or 0; images never tell them apart:
///
/// ```text
/// (q1, q2, q3) = (q1, q2 + pi, -q3) = (q1, q2 - pi, -q3)
/// ```
fn turn([insertion, rotation, bending]: PerDof<f64>, half_turn: f64) -> PerDof<f64> {
    let side = if half_turn.abs() > 0.0 { -1.0 } else { 1.0 };
    [insertion, rotation + half_turn, side * bending]
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
            let [insertion, named, bending] = turn(state, half_turn(expected, state));
            assert!((named - 0.2).abs() <= FRAC_PI_2 + 1e-12, "{rotation}");
            let turns = (named - rotation) / PI;
            assert!((turns - turns.round()).abs() < 1e-12 && turns.abs() < 1.5);
            let side = if turns.abs() > 0.5 { -0.9 } else { 0.9 };
            assert!((insertion - 0.03).abs() + (bending - side).abs() < 1e-12);
        }
    }
}
