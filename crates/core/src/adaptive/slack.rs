//! The slack of one DOF as profile `best` believes in it: a play whose offsets change with the tip's position.

use crate::adaptive::contact::Motion;
use crate::adaptive::friction::SlackShare;
use crate::adaptive::offset_map::{OffsetMap, OffsetPrior, Side, TILTS};
use crate::adaptive::sharing::Sharing;
use crate::adaptive::withheld::{ChangeLimit, Withheld};
use crate::article::estimator::{Trigger, Triggers};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;

/// What was learnt of both contact offsets, and the most of it that is believed; in the unit of the DOF.
#[derive(Debug, Clone, PartialEq)]
pub struct Slack {
    learnt: OffsetMap,
    withheld: Withheld,
    limit: PlayLimit,
    part: SlackShare,
    sharing: Sharing,
    /// How much of its friction the other DOF shares.
    of_other: f64,
}

impl Slack {
    /// The offsets of `play` everywhere, trusted as far as the prior says, without limit.
    pub fn new(prior: OffsetPrior, limit: ChangeLimit, play: Play) -> Self {
        // With a gain to be learnt a change here is another one elsewhere: no offset is ever known.
        let known = if prior.tilt > 0.0 {
            f64::INFINITY
        } else {
            limit.known
        };
        let limit = ChangeLimit { known, ..limit };
        Self {
            learnt: OffsetMap::new(prior, play.delta_minus(), play.delta_plus()),
            withheld: Withheld::new(limit),
            limit: PlayLimit::NONE,
            part: SlackShare::WHOLE,
            sharing: Sharing::new(),
            of_other: 1.0,
        }
    }

    /// See [`OffsetMap::centre`].
    pub const fn centre(&mut self, position: f64) {
        self.learnt.centre(position);
    }

    /// Believe in no more slack than that.
    pub const fn set_limit(&mut self, limit: PlayLimit) {
        self.limit = limit;
    }

    /// The most slack that is believed.
    pub const fn limit(&self) -> PlayLimit {
        self.limit
    }

    /// Whether more slack than may be was learnt at a position.
    pub fn is_limited(&self, position: f64) -> bool {
        let [minus, plus] = self.learnt(position);
        self.limit.exceeds(minus, plus)
    }

    /// So much of it is left for this DOF if all friction is shared; the other DOF shares so much of its own.
    pub const fn set_slack_share(&mut self, part: SlackShare, of_other: f64) {
        (self.part, self.of_other) = (part, of_other);
    }

    /// How much of its friction is shared, 0 to 1, as its offsets say.
    pub const fn shared(&self) -> f64 {
        self.sharing.shared()
    }

    /// The same as far as the other DOF shares its own: what is not shared by both is by none.
    const fn common(&self) -> f64 {
        self.shared().min(self.of_other)
    }

    /// The share of the width that is left.
    fn left(&self, part: f64) -> f64 {
        1.0 - self.common() * (1.0 - part)
    }

    /// Both offsets at a position, within the limit, where that share of the width is left.
    fn offsets(&self, position: f64, part: f64) -> [f64; 2] {
        let share = self.left(part);
        let [minus, plus] = self.withheld.trusted(self.learnt(position));
        let [minus, plus] = self.limit.clamp(minus, plus);
        let nearer = (1.0 - share) / 2.0 * (plus - minus);
        [minus + nearer, plus - nearer]
    }

    /// The reference moved for so long, in s.
    pub fn pass(&mut self, time: f64) {
        self.withheld.pass(time);
    }

    /// Both, as they were learnt.
    fn learnt(&self, position: f64) -> [f64; 2] {
        Side::BOTH.map(|side| self.learnt.offset(side, position))
    }

    /// One of them, as it is now.
    pub fn offset(&self, side: Side, position: f64) -> f64 {
        side.of(self.offsets(position, self.part.now))
    }

    /// One of them, as it will be when the tip slides as it is to.
    pub fn aimed(&self, side: Side, position: f64) -> f64 {
        side.of(self.offsets(position, self.part.aimed))
    }

    /// The variance of an offset at a position.
    pub fn variance(&self, side: Side, position: f64) -> f64 {
        self.learnt.variance(side, position)
    }

    /// The play operator of this DOF by itself at a position.
    pub fn play(&self, position: f64) -> Play {
        let [minus, plus] = self.learnt(position);
        // Sides that have crossed are a width too, and limited as one.
        let [minus, plus] = self.limit.clamp(minus.min(plus), minus.max(plus));
        Play::from_ordered(minus, plus)
    }

    /// Half the width learnt at a position, whatever the limit: shares of it are shares all the same.
    pub fn half_width(&self, position: f64) -> f64 {
        let [minus, plus] = self.learnt(position);
        (plus - minus).abs() / 2.0
    }

    /// Travel of the command for a tip in contact to travel 1.
    pub fn stretch(&self) -> f64 {
        1.0 + self.learnt.tilt().0
    }

    /// Travel of the tip over the command's in contact: mean and standard deviation.
    pub fn gain(&self) -> (f64, f64) {
        let gain = 1.0 / self.stretch();
        (gain, gain * gain * self.learnt.tilt().1)
    }

    /// Between which the gain in contact may be. One does not exclude 1.
    pub fn gains(&self) -> (f64, f64) {
        let (tilt, deviation) = self.learnt.tilt();
        let [most, least] =
            [-2.0, 2.0].map(|by| 1.0 + (tilt + by * deviation).clamp(TILTS.0, TILTS.1));
        (1.0 / least, (1.0 / most).min(1.0).max(1.0 / (1.0 + tilt)))
    }

    /// Where the tip is when the command comes to be there: between the contacts, whose offsets
    /// change with where the tip is.
    pub fn carried(&self, tip: f64, command: f64) -> f64 {
        let [minus, plus] = Side::BOTH.map(|side| {
            let beyond = command - self.offset(side, tip) - tip;
            tip + beyond / self.stretch()
        });
        tip.max(plus.min(minus)).min(plus.max(minus))
    }

    /// Learn from how a measurement with this variance belongs to the others of its stroke: in contact it is an
    /// offset; beyond the contact believed in, a bound of one.
    pub fn learn(
        &mut self,
        motion: Motion,
        command: f64,
        measured: f64,
        variance: f64,
    ) -> Triggers {
        let before = self.learnt(measured);
        self.learnt.travel(motion.travel);
        let doubt = self.common() * self.part.deviation * self.half_width(measured);
        let (own, variance) = (variance, variance + doubt * doubt);
        let mut triggers = Triggers::default();
        let offset = command - measured;
        let (side, sign, trigger) = if motion.upwards {
            (Side::Plus, 1.0, &mut triggers.plus)
        } else {
            (Side::Minus, -1.0, &mut triggers.minus)
        };
        if motion.together {
            let share = self.left(self.part.now);
            self.learnt.measure(side, measured, share, offset, variance);
            self.sharing.learn(side, 1.0 - self.part.now, offset, own);
            *trigger = Some(Trigger::Contact);
        } else if sign * (offset - self.offset(side, measured)) > libm::sqrt(variance) {
            self.learnt.bound(side, measured, offset, variance);
            *trigger = Some(Trigger::Violation);
        }
        let after = self.learnt(measured);
        self.withheld.learn(before, after, triggers, motion.travel);
        triggers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: ChangeLimit = ChangeLimit {
        rate: 1.0,
        spare: 1.0,
        known: 1.0,
    };

    #[test]
    fn what_is_not_shared_by_both_is_by_none() {
        let prior = OffsetPrior {
            spacing: 1.0,
            level: 1.0,
            tilt: 0.0,
            local: 1.0,
            correlation: 10.0,
            level_drift: 0.0,
            tilt_drift: 0.0,
            local_drift: 0.0,
            symmetry: 0.0,
        };
        let mut slack = Slack::new(prior, LIMIT, Play::from_ordered(-1.0, 3.0));
        let part = SlackShare {
            now: 0.0,
            aimed: 0.5,
            deviation: 0.0,
        };
        for (of_other, now, aimed) in [(0.0, 3.0, 3.0), (0.5, 2.0, 2.5), (1.0, 1.0, 2.0)] {
            slack.set_slack_share(part, of_other);
            assert!(
                (slack.offset(Side::Plus, 0.0) - now).abs() < 1e-12,
                "{of_other}"
            );
            assert!(
                (slack.aimed(Side::Plus, 0.0) - aimed).abs() < 1e-12,
                "{of_other}"
            );
        }
    }
}
