//! On-line estimation of the contact offsets, Eqs. (4)-(6), Fig. 3.

use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::error::{ConfigError, require_fraction, require_positive};

/// Estimates the two contact offsets from command and measured output while the DOF moves.
///
/// Each time the command c has moved by `update_distance` since the last update, with the
/// changes dc and dm of command and measured output m since then (offsets are c - m):
///
/// ```text
/// delta_plus  if  dc > 0 and |dc - dm| < contact_tolerance |dc|     contact      Eq. (4)
///             or  m < c - delta_plus                                violation    Eq. (5)
/// delta_minus if  dc < 0 and |dc - dm| < contact_tolerance |dc|
///             or  m > c - delta_minus
/// delta <- (1 - a) delta + a (c - m)                                             Eq. (6)
/// ```
///
/// Ours: a = 1 - (1 - `smoothing_factor`)^(|dc| / `update_distance`), which is the article's factor
/// at exactly one `update_distance`. Images come at a fixed rate, so a fast motion covers several
/// distances between two of them; counted per distance, the result does not depend on that rate.
///
/// The article's signs are made consistent (decision 0001). `delta_minus <= delta_plus` always.
///
/// Wrong when c and m are not of the same instant: a delay reads as width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimator {
    update_distance: f64,
    contact_tolerance: f64,
    smoothing_factor: f64,
}

/// The state of an [`Estimator`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimatorState {
    play: Play,
    last: Option<(f64, f64)>,
}

/// Why an offset was updated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// Command and output moved together, Eq. (4). Reported when both conditions held.
    Contact,
    /// The output lay where the offsets do not allow it, Eq. (5).
    Violation,
}

/// Why each offset was updated, if it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Triggers {
    /// Of `delta_minus`.
    pub minus: Option<Trigger>,
    /// Of `delta_plus`.
    pub plus: Option<Trigger>,
}

impl Triggers {
    /// Whether any offset was updated.
    pub const fn any(&self) -> bool {
        self.minus.is_some() || self.plus.is_some()
    }
}

impl EstimatorState {
    /// The state before the first measurement, with the initial offsets.
    pub const fn new(play: Play) -> Self {
        Self { play, last: None }
    }

    /// Limits the estimated offsets; returns whether they exceeded the limit.
    pub(crate) fn limit(&mut self, limit: PlayLimit) -> bool {
        let (minus, plus) = (self.play.delta_minus(), self.play.delta_plus());
        let exceeds = limit.exceeds(minus, plus);
        if exceeds {
            let [minus, plus] = limit.clamp(minus, plus);
            self.play = Play::from_ordered(minus, plus);
        }
        exceeds
    }

    /// The play operator estimated so far.
    pub const fn play(&self) -> Play {
        self.play
    }
}

impl Estimator {
    /// An estimator with tau `update_distance` in the unit of the DOF, epsilon
    /// `contact_tolerance` and alpha `smoothing_factor`, both without unit.
    ///
    /// # Errors
    /// `update_distance` is not a finite number above 0, or one of the others not in (0, 1).
    pub fn new(
        update_distance: f64,
        contact_tolerance: f64,
        smoothing_factor: f64,
    ) -> Result<Self, ConfigError> {
        require_positive("update_distance", update_distance)?;
        require_fraction("contact_tolerance", contact_tolerance)?;
        require_fraction("smoothing_factor", smoothing_factor)?;
        Ok(Self {
            update_distance,
            contact_tolerance,
            smoothing_factor,
        })
    }

    /// Updates the offsets from the command and the output measured at the same instant.
    ///
    /// A pair that is not finite is ignored. The first pair is only stored.
    pub fn update(&self, state: &mut EstimatorState, command: f64, measured: f64) -> Triggers {
        let offset = command - measured;
        if !offset.is_finite() {
            return Triggers::default();
        }
        let Some((last_command, last_measured)) = state.last else {
            state.last = Some((command, measured));
            return Triggers::default();
        };
        let moved = command - last_command;
        if moved.abs() < self.update_distance {
            return Triggers::default();
        }
        state.last = Some((command, measured));

        let followed = measured - last_measured;
        let together = (moved - followed).abs() < self.contact_tolerance * moved.abs();
        let (minus, plus) = (state.play.delta_minus(), state.play.delta_plus());
        let triggers = Triggers {
            minus: trigger(together && moved < 0.0, offset < minus),
            plus: trigger(together && moved > 0.0, offset > plus),
        };
        let factor = self.factor(moved.abs());
        let next = |delta: f64, fired: Option<Trigger>| match fired {
            Some(_) => blend(delta, offset, factor),
            None => delta,
        };
        state.play = Play::from_ordered(next(minus, triggers.minus), next(plus, triggers.plus));
        triggers
    }

    fn factor(&self, distance: f64) -> f64 {
        1.0 - libm::pow(1.0 - self.smoothing_factor, distance / self.update_distance)
    }
}

fn trigger(contact: bool, violation: bool) -> Option<Trigger> {
    if contact {
        Some(Trigger::Contact)
    } else if violation {
        Some(Trigger::Violation)
    } else {
        None
    }
}

/// Eq. (6), clamped to the interval that rounding may leave, so that the offsets keep their order.
fn blend(delta: f64, offset: f64, factor: f64) -> f64 {
    let mixed = (1.0 - factor) * delta + factor * offset;
    mixed.max(delta.min(offset)).min(delta.max(offset))
}
