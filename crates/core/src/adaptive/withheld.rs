//! How fast slack that is known may change.

use crate::adaptive::offset_map::Side;
use crate::article::estimator::Triggers;
use crate::error::{ConfigError, require_non_negative};

/// Bounds what lying images can make of the slack that is acted on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeLimit {
    /// Most that a known offset changes in a second of motion, in the unit of the DOF.
    pub rate: f64,
    /// So much more is taken at once, in the unit of the DOF: what noise and place make of an offset.
    pub spare: f64,
    /// Travel in contact, on either side, after which the offsets are known, in the unit of the DOF.
    pub known: f64,
}

impl ChangeLimit {
    /// The same, checked.
    ///
    /// # Errors
    /// One is negative, or not a finite number.
    pub fn checked(self) -> Result<Self, ConfigError> {
        require_non_negative("change_rate", self.rate)?;
        require_non_negative("change_spare", self.spare)?;
        require_non_negative("known_travel", self.known)?;
        Ok(self)
    }
}

/// What was learnt of both contact offsets and is not yet acted on; in the unit of the DOF.
///
/// A scope changes its slack in seconds, a picture that lies in no time. So offsets that are known are acted on as
///
/// ```text
/// w <- w + g, then towards 0 by rate t         g: what an image changed of an offset, where it was seen
/// acted on: learnt - (w - clamp(w, -spare, spare))    t: time in which the reference moved
/// ```
///
/// What was learnt stays as it is, so that images that tell the truth again take back at once what others taught.
///
/// Wrong while an instrument's slack does change faster: by the difference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Withheld {
    limit: ChangeLimit,
    amounts: [f64; 2],
    /// Travel over which each contact was measured.
    seen: [f64; 2],
    /// Since the last image that taught, in s.
    moving: f64,
}

impl Withheld {
    /// Nothing known yet.
    pub const fn new(limit: ChangeLimit) -> Self {
        Self {
            limit,
            amounts: [0.0; 2],
            seen: [0.0; 2],
            moving: 0.0,
        }
    }

    /// Both offsets as they may be acted on, of those learnt.
    pub fn trusted(&self, [minus, plus]: [f64; 2]) -> [f64; 2] {
        let spare = self.limit.spare;
        let [a, b] = self.amounts.map(|much| much - much.clamp(-spare, spare));
        [minus - a, plus - b]
    }

    /// The reference moved for so long, in s.
    pub fn pass(&mut self, time: f64) {
        self.moving += time;
    }

    /// An image changed both offsets where it was, after this travel; which of them it measured.
    pub fn learn(&mut self, before: [f64; 2], after: [f64; 2], triggers: Triggers, travel: f64) {
        let measured = [triggers.minus, triggers.plus];
        if measured == [None; 2] {
            return;
        }
        let allowed = self.limit.rate * core::mem::take(&mut self.moving);
        for (seen, measured) in self.seen.iter_mut().zip(measured) {
            *seen += if measured.is_some() { travel } else { 0.0 };
        }
        if self.seen.iter().any(|seen| *seen < self.limit.known) {
            return;
        }
        for (side, withheld) in Side::BOTH.into_iter().zip(&mut self.amounts) {
            *withheld += side.of(after) - side.of(before);
            *withheld -= withheld.clamp(-allowed, allowed);
        }
    }
}
