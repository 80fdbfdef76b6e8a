//! The bounded-gain inverse whose lead over the reference is a function of what is known now.

use crate::error::{ConfigError, require};

/// How the command leads the reference: what the article's Eqs. (2)-(3) leave, closed.
///
/// The command that puts the tip where it is asked to be is u + delta(u), with the offset delta of
/// the contact that the motion will use. It travels s = 1 + d delta / du for each travel of 1 of the
/// reference, the `stretch`. The lead l = c - u therefore moves towards delta:
///
/// ```text
/// dc = K du,   0 <= K <= gain_limit
/// free zone    K = free_gain, falling to s contact_gain over the last `taper` of the gap
/// in contact   K = s (1 + (contact_gain - 1) clamp((delta - l) / settling, -1, 1))
/// ```
///
/// so the lead arrives at delta and stays: no share of the width is left, and nothing is summed up.
/// Without motion nothing moves. New offsets move nothing by themselves either.
///
/// Wrong as far as delta is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeadLaw {
    /// K in the free zone.
    pub free_gain: f64,
    /// Largest speed of a tip in contact over that of the reference; 1 compensates nothing.
    pub contact_gain: f64,
    /// Length of the end of the gap over which K falls, in the unit of the DOF.
    pub taper: f64,
    /// Lead yet missing below which K in contact falls to 1, in the unit of the DOF.
    pub settling: f64,
}

impl LeadLaw {
    /// The same, checked.
    ///
    /// # Errors
    /// `1 <= contact_gain <= free_gain` or a length above 0 is not given.
    pub fn checked(self) -> Result<Self, ConfigError> {
        let finite = self.free_gain.is_finite() && self.free_gain >= 1.0;
        require(
            finite,
            "free_gain",
            self.free_gain,
            "a finite number, 1 or above",
        )?;
        let contact = (1.0..=self.free_gain).contains(&self.contact_gain);
        require(
            contact,
            "contact_gain",
            self.contact_gain,
            "at least 1, at most free_gain",
        )?;
        crate::error::require_positive("taper", self.taper)?;
        crate::error::require_positive("settling", self.settling)?;
        Ok(self)
    }

    /// What the lead gains over a travel of the reference at a stretch s, with `gap` of the free zone
    /// before it and `missing` of the lead after it, had it gained nothing. Everything counts in
    /// the direction of motion.
    ///
    /// Each phase is solved exactly, so the length of a tick does not matter.
    pub fn gain(&self, travel: f64, stretch: f64, gap: f64, missing: f64) -> f64 {
        let stretch = stretch.max(1.0 / self.free_gain).min(self.free_gain);
        let (mut left, mut lead, mut gap) = (travel, 0.0, gap.max(0.0));
        let landing = (stretch * self.contact_gain).min(self.free_gain);
        if gap > 0.0 && missing > 0.0 {
            // At the full gain, then with K = landing + slope gap, which decays.
            let full = (gap - self.taper).max(0.0) / self.free_gain;
            let first = left.min(full);
            lead += (self.free_gain - 1.0) * first;
            gap -= self.free_gain * first;
            left -= first;
            if left > 0.0 {
                let slope = (self.free_gain - landing) / self.taper;
                let rest = taper_travel(slope, landing, gap);
                let part = left.min(rest);
                let moved = if part >= rest {
                    gap
                } else if slope > 0.0 {
                    // gap' = -(landing + slope gap)
                    gap - (gap + landing / slope) * libm::exp(-slope * part) + landing / slope
                } else {
                    landing * part
                };
                lead += moved - part;
                left -= part;
            }
            if lead >= missing {
                return missing;
            }
        }
        let drift = (stretch - 1.0) * left;
        lead + drift + self.settle(stretch * left, missing - drift - lead)
    }

    /// The lead gained in contact beyond what the stretch asks for: at the full rate, then decaying.
    fn settle(&self, travel: f64, missing: f64) -> f64 {
        let rate = self.contact_gain - 1.0;
        if rate == 0.0 || missing == 0.0 {
            return 0.0;
        }
        let far = (missing.abs() - self.settling).max(0.0);
        // Not below K = 0: the command may wait for the reference, not turn back.
        let fast = if missing < 0.0 { rate.min(1.0) } else { rate };
        let first = travel.min(far / fast);
        let near = missing.abs() - fast * first;
        let moved =
            fast * first - near * libm::expm1(-fast * (travel - first).max(0.0) / self.settling);
        moved.copysign(missing)
    }
}

/// Travel that the tapered end of a gap takes.
fn taper_travel(slope: f64, landing: f64, gap: f64) -> f64 {
    if slope > 0.0 {
        libm::log1p(slope * gap / landing) / slope
    } else {
        gap / landing
    }
}
