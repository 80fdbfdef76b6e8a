//! Where the instrument is, to the best of the loop's knowledge: for looking, not for learning.

use crate::article::state::StateEstimate;
use crate::dof::PerDof;
use crate::error::{ConfigError, require_non_negative, require_positive};
use crate::estimation::history::Entry;
use crate::estimation::posture::{Belief, half_turn, turn};
use crate::math::linear::{add, square};

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
}

/// What the last images said, per DOF, and how it has aged.
///
/// ```text
/// state = q + (q_hat - q)_last - (what images have moved q by since)
/// deviation^2 = deviation_last^2 + rest_deviation^2 + moved^2,  at most start_deviation^2
/// moved = max(travel - travel_last, arrived - arrived_last)
/// arrived = arrived_last + (travel - arrived_last) elapsed / (settling_time + elapsed)
/// ```
///
/// with the travel of [`Entry`]: whatever the slack does, the tip moves no farther. But it does so
/// later, and goes on when the command has come to rest; `arrived` is how far of the travel it has had the time to go.
/// `deviation_last` has the
/// image's own and, of the linear step of Eq. (16), a quarter of the correction. Every image without markers makes it
/// half as large again, up to a part of `start_deviation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whereabouts {
    settings: WhereaboutsSettings,
    last: PerDof<Last>,
}

/// One DOF at the last image that determined it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Last {
    /// `q_hat - q`, and what images had moved q by when it was taken.
    correction: f64,
    deviation: f64,
    time: f64,
    travel: f64,
    arrived: f64,
}

impl Last {
    fn arrived(&self, settling_time: f64, time: f64, travel: f64) -> f64 {
        let elapsed = time - self.time;
        // A clock may go back.
        let share = if elapsed > 0.0 {
            elapsed / (settling_time + elapsed)
        } else {
            0.0
        };
        self.arrived + share * (travel - self.arrived)
    }

    fn moved(&self, settling_time: f64, time: f64, travel: f64) -> f64 {
        let arrived = self.arrived(settling_time, time, travel);
        (travel - self.travel).max(arrived - self.arrived)
    }
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
        let last = settings.start_deviation.map(|deviation| Last {
            correction: 0.0,
            deviation,
            time: 0.0,
            travel: 0.0,
            arrived: 0.0,
        });
        Ok(Self { settings, last })
    }

    /// What is believed of the state at a moment of the history.
    pub(crate) fn at(&self, past: &Entry) -> Belief {
        let settings = &self.settings;
        let mut belief = Belief {
            state: add(past.predicted_state, -1.0, past.corrected),
            deviation: settings.start_deviation,
        };
        let now = belief.state.iter_mut().zip(&mut belief.deviation);
        let grown = past.travel.iter().zip(settings.rest_deviation);
        for ((state, deviation), ((travel, rest), last)) in now.zip(grown.zip(self.last)) {
            let moved = last.moved(settings.settling_time, past.time, *travel);
            *state += last.correction;
            let variance = square(last.deviation) + square(rest) + square(moved);
            *deviation = deviation.min(libm::sqrt(variance));
        }
        belief.state = turn(belief.state, half_turn(past.predicted_state, belief.state));
        belief
    }

    /// How far each DOF may have gone since the last image, `moved`.
    pub(crate) fn moved(&self, past: &Entry) -> PerDof<f64> {
        let mut moved = past.travel;
        for (moved, last) in moved.iter_mut().zip(self.last) {
            *moved = last.moved(self.settings.settling_time, past.time, *moved);
        }
        moved
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
        let Belief { state, deviation } = self.at(past);
        let mut wider = deviation;
        for (deviation, start) in wider.iter_mut().zip(self.settings.start_deviation) {
            *deviation = deviation.max((MISS * *deviation).min(MISSED * start));
        }
        self.set(past, state, wider, [true; 3]);
    }

    fn set(
        &mut self,
        past: &Entry,
        state: PerDof<f64>,
        deviation: PerDof<f64>,
        known: PerDof<bool>,
    ) {
        let settling_time = self.settings.settling_time;
        let correction = add(add(state, -1.0, past.predicted_state), 1.0, past.corrected);
        let new = correction.iter().zip(deviation).zip(past.travel);
        for ((last, known), ((correction, deviation), travel)) in
            self.last.iter_mut().zip(known).zip(new)
        {
            if known && deviation.is_finite() {
                *last = Last {
                    correction: *correction,
                    deviation,
                    time: past.time,
                    travel,
                    arrived: last.arrived(settling_time, past.time, travel),
                };
            }
        }
    }
}
