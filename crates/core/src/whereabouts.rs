//! Where the instrument is, to the best of the loop's knowledge: for looking, not for learning.

use crate::dof::PerDof;
use crate::error::{ConfigError, require_non_negative, require_positive};
use crate::history::Entry;
use crate::linear::{add, square, times};
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

/// What a [`Whereabouts`] is set to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhereaboutsSettings {
    /// Before the first image, from the prediction: standard deviation [m, rad, rad].
    pub start_deviation: PerDof<f64>,
    /// How far an idle tip moves between two images: standard deviation [m, rad, rad].
    pub rest_deviation: PerDof<f64>,
    /// How long a tip still moves after its command has come to rest: time constant in s.
    pub settling_time: f64,
    /// What motion of the DOFs moves each of them, in the units of `start_deviation`.
    pub coupling: f64,
}

/// What the last images said, per DOF, and how it has aged.
///
/// ```text
/// state = q + (q_hat - q)_last - (what images have moved q by since)
/// deviation^2 = deviation_last^2 + rest_deviation^2 + moved^2 + shared^2,  at most start_deviation^2
/// moved = max(travel - travel_last, arrived - arrived_last)
/// shared = coupling start_deviation sqrt(sum over the DOFs of (moved / start_deviation)^2)
/// ```
///
/// with the travel of the command, forth and back, and `arrived`, the same through a lag of `settling_time`: whatever
/// the slack does, the tip moves no farther than the command, but it does so later, and goes on when the command has
/// stopped. `shared` is what friction that is shared moves: a DOF that slides lets go of the others.
/// `deviation_last` has the image's own and, of the linear
/// step of Eq. (16), a quarter of the correction. Every image without markers makes it half as large again,
/// up to a part of `start_deviation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whereabouts {
    settings: WhereaboutsSettings,
    /// `q_hat - q`, and what images had moved q by when it was taken.
    correction: PerDof<f64>,
    /// At the last image that determined the DOF.
    deviation: PerDof<f64>,
    travel: PerDof<f64>,
    arrived: PerDof<f64>,
}

impl Whereabouts {
    /// Before the first image: at the prediction.
    ///
    /// # Errors
    /// A start deviation is not a finite number above 0, or another setting not one from 0 on.
    pub fn new(settings: WhereaboutsSettings) -> Result<Self, ConfigError> {
        for start in settings.start_deviation {
            require_positive("start_deviation", start)?;
        }
        for rest in settings.rest_deviation {
            require_non_negative("rest_deviation", rest)?;
        }
        require_non_negative("settling_time", settings.settling_time)?;
        require_non_negative("coupling", settings.coupling)?;
        Ok(Self {
            settings,
            correction: [0.0; 3],
            deviation: settings.start_deviation,
            travel: [0.0; 3],
            arrived: [0.0; 3],
        })
    }

    /// How far of the travel the tip has had the time to go `elapsed` in s after `arrived`.
    pub(crate) fn arrive(
        &self,
        arrived: PerDof<f64>,
        travel: PerDof<f64>,
        elapsed: f64,
    ) -> PerDof<f64> {
        let share = elapsed / (self.settings.settling_time + elapsed);
        // The first tick has none before it, and a clock may go back.
        let share = if elapsed > 0.0 { share } else { 0.0 };
        add(arrived, share, add(travel, -1.0, arrived))
    }

    /// What is believed of the state at a moment of the history.
    pub(crate) fn at(&self, past: &Entry) -> Belief {
        let start = self.settings.start_deviation;
        let commanded = add(past.travel, -1.0, self.travel);
        let late = add(past.arrived, -1.0, self.arrived);
        let (mut moved, mut shared) = (commanded, 0.0);
        for ((moved, late), unit) in moved.iter_mut().zip(late).zip(start) {
            *moved = moved.max(late);
            shared += square(self.settings.coupling * *moved / unit);
        }
        let variance = [
            (self.deviation, 1.0),
            (self.settings.rest_deviation, 1.0),
            (moved, 1.0),
            (start, shared),
        ];
        let variance = variance.iter().fold([0.0; 3], |sum, (each, share)| {
            add(sum, *share, times(*each, *each))
        });
        let state = add(past.predicted_state, 1.0, self.correction);
        let mut deviation = start;
        for (deviation, variance) in deviation.iter_mut().zip(variance) {
            *deviation = deviation.min(libm::sqrt(variance));
        }
        Belief {
            state: add(state, -1.0, past.corrected),
            deviation,
        }
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
        for (deviation, start) in self.deviation.iter_mut().zip(self.settings.start_deviation) {
            *deviation = deviation.max((MISS * *deviation).min(MISSED * start));
        }
        (self.travel, self.arrived) = (past.travel, past.arrived);
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
        let when = past.travel.iter().zip(past.arrived);
        let mine = self.correction.iter_mut().zip(&mut self.deviation);
        let ages = self.travel.iter_mut().zip(&mut self.arrived);
        for ((((state, deviation), known), (predicted, corrected)), (mine, (ages, when))) in
            now.zip(then).zip(mine.zip(ages.zip(when)))
        {
            if known && deviation.is_finite() {
                *mine.0 = state - predicted + corrected;
                *mine.1 = deviation;
                (*ages.0, *ages.1) = (*when.0, when.1);
            }
        }
    }
}
