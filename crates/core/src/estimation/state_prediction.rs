//! State prediction of profile `paper` for the marker detection.

use crate::dof::zip_with;
use crate::error::{ConfigError, require_positive};
use crate::estimation::expectation::StatePrior;
use crate::estimation::history::Entry;
use crate::math::linear::square;

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
pub struct StatePrediction<const N: usize> {
    start_deviation: [f64; N],
    last: [Last; N],
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
pub fn step_deviation<const N: usize>(
    past: &Entry<N>,
    state: [f64; N],
    deviation: [f64; N],
) -> [f64; N] {
    let step = zip_with(state, past.predicted_state, |state, q| state - q);
    zip_with(deviation, step, |own, step| {
        libm::sqrt(square(own) + square(STEP_ERROR * step))
    })
}

impl<const N: usize> StatePrediction<N> {
    /// Before the first image: at the prediction.
    ///
    /// # Errors
    /// A start deviation is not a finite number above 0.
    pub fn new(start_deviation: [f64; N]) -> Result<Self, ConfigError> {
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
    pub(crate) fn at(&self, past: &Entry<N>) -> StatePrior<N> {
        let mut prior = StatePrior {
            state: zip_with(past.predicted_state, past.corrected, |q, moved| q - moved),
            deviation: self.start_deviation,
        };
        let now = prior.state.iter_mut().zip(&mut prior.deviation);
        for (((state, deviation), travel), last) in now.zip(past.travel).zip(self.last) {
            *state += last.correction;
            let moved = travel - last.travel;
            let variance = square(last.deviation) + square(moved);
            *deviation = deviation.min(libm::sqrt(variance));
        }
        prior
    }

    /// Makes the prediction `prior` less certain after an image without markers.
    pub(crate) fn miss(&mut self, past: &Entry<N>, prior: &StatePrior<N>) {
        let wider = zip_with(prior.deviation, self.start_deviation, |own, start| {
            own.max((MISS * own).min(MISSED * start))
        });
        self.set(past, prior.state, wider, [true; N]);
    }

    /// Makes the prediction `prior` as uncertain as at the start.
    pub(crate) fn reset(&mut self, past: &Entry<N>, prior: &StatePrior<N>) {
        self.set(past, prior.state, self.start_deviation, [true; N]);
    }

    /// Sets the prediction of the DOFs that are `known` to an estimate by one linear step, with its standard deviation by
    /// [`step_deviation`].
    pub(crate) fn set(
        &mut self,
        past: &Entry<N>,
        state: [f64; N],
        deviation: [f64; N],
        known: [bool; N],
    ) {
        let apart = zip_with(state, past.predicted_state, |state, q| state - q);
        let correction = zip_with(apart, past.corrected, |apart, moved| apart + moved);
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
