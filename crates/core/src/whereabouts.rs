//! Where the instrument is, to the best of the loop's knowledge: for looking, not for learning.

use crate::dof::PerDof;
use crate::error::{ConfigError, require_non_negative, require_positive};
use crate::history::Entry;
use crate::linear::square;
use crate::posture::Belief;
use crate::state::StateEstimate;

/// One linear step from far away misses by a part of itself.
const STEP_ERROR: f64 = 0.25;
/// What an image does to the belief's deviation of which a marker was left out: it makes nothing surer. Were the
/// belief wrong, it would otherwise refuse every image to come.
const DOUBT: f64 = 1.25;
/// What an image without markers does to the belief's deviation. A tip that slid on while its command rested is
/// not where it is looked for; it is found again when the search has grown to where it is.
const MISS: f64 = 1.5;
/// The largest share of the start's deviation that comes of missing images: with more, a bend the other way, half a
/// turn on, is found as well.
const MISSED: f64 = 0.15;

/// What the last images said, per DOF, and how it has aged.
///
/// ```text
/// state = q + (q_hat - q)_last - (what images have moved q by since)
/// deviation^2 = deviation_last^2 + rest_deviation^2 + (travel - travel_last)^2,  at most start_deviation^2
/// ```
///
/// with the travel of the command, forth and back: whatever the slack does, the tip has moved no
/// farther than the command, but for `rest_deviation`. `deviation_last` has the image's own and, of the linear
/// step of Eq. (16), a quarter of the correction. Every image without markers makes it half as large again,
/// up to a part of `start_deviation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whereabouts {
    start_deviation: PerDof<f64>,
    rest_deviation: PerDof<f64>,
    /// `q_hat - q`, and what images had moved q by when it was taken.
    correction: PerDof<f64>,
    /// At the last image that determined the DOF.
    deviation: PerDof<f64>,
    travel: PerDof<f64>,
}

impl Whereabouts {
    /// Before the first image: at the prediction, with `start_deviation` (3,); between two images an
    /// idle tip moves by `rest_deviation` (3,); standard deviations [m, rad, rad].
    ///
    /// # Errors
    /// A start deviation is not a finite number above 0, or another not one from 0 on.
    pub fn new(
        start_deviation: PerDof<f64>,
        rest_deviation: PerDof<f64>,
    ) -> Result<Self, ConfigError> {
        for (start, rest) in start_deviation.into_iter().zip(rest_deviation) {
            require_positive("start_deviation", start)?;
            require_non_negative("rest_deviation", rest)?;
        }
        Ok(Self {
            start_deviation,
            rest_deviation,
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
        let then = past.corrected.iter().zip(past.travel);
        let now = belief
            .state
            .iter_mut()
            .zip(&mut belief.deviation)
            .zip(self.rest_deviation);
        for (
            (((state, deviation), rest), (corrected, travel)),
            ((correction, last), travel_last),
        ) in now.zip(then).zip(known)
        {
            *state += correction - corrected;
            let moved = square(rest) + square(travel - travel_last);
            *deviation = deviation.min(libm::sqrt(square(last) + moved));
        }
        belief
    }

    /// Takes in what one linear step determined.
    pub(crate) fn learn(&mut self, past: &Entry, estimate: &StateEstimate, deviation: PerDof<f64>) {
        let mut own = deviation;
        let seen = estimate.state.iter().zip(past.predicted_state);
        for (own, (state, predicted)) in own.iter_mut().zip(seen) {
            *own = libm::sqrt(square(*own) + square(STEP_ERROR * (state - predicted)));
        }
        self.set(past, estimate.state, own, estimate.observable);
    }

    /// Takes in what was most probable.
    pub(crate) fn settle(
        &mut self,
        past: &Entry,
        state: PerDof<f64>,
        deviation: PerDof<f64>,
        left_out: bool,
    ) {
        let deviation = if left_out {
            self.at(past).deviation.map(|value| DOUBT * value)
        } else {
            deviation
        };
        self.set(past, state, deviation, [true; 3]);
    }

    /// Takes in that the markers were not found where they should be.
    pub(crate) fn miss(&mut self, past: &Entry) {
        self.deviation = self.at(past).deviation;
        for (deviation, start) in self.deviation.iter_mut().zip(self.start_deviation) {
            *deviation = deviation.max((MISS * *deviation).min(MISSED * start));
        }
        self.travel = past.travel;
    }

    fn set(
        &mut self,
        past: &Entry,
        state: PerDof<f64>,
        deviation: PerDof<f64>,
        known: PerDof<bool>,
    ) {
        let now = state.iter().zip(deviation).zip(known);
        let then = past.predicted_state.iter().zip(past.corrected);
        let mine = self
            .correction
            .iter_mut()
            .zip(&mut self.deviation)
            .zip(self.travel.iter_mut().zip(past.travel));
        for ((((correction, last), (travel_last, travel)), (predicted, corrected)), new) in
            mine.zip(then).zip(now)
        {
            let ((state, deviation), known) = new;
            if known && deviation.is_finite() {
                *correction = state - predicted + corrected;
                *last = deviation;
                *travel_last = travel;
            }
        }
    }
}
