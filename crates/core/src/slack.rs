//! The slack of one DOF as profile `best` believes in it: a play whose offsets change with the tip's position.

use crate::contact::Motion;
use crate::estimator::{Trigger, Triggers};
use crate::friction::SlackShare;
use crate::limits::PlayLimit;
use crate::offset_map::{OffsetMap, OffsetPrior, Side, TILTS};
use crate::play::Play;
use crate::withheld::{ChangeLimit, Withheld};

/// How fast it is learnt how much of the friction is shared: share of the error, per image.
const SHARING: f64 = 0.1;

/// What was learnt of both contact offsets, and the most of it that is believed; in the unit of the DOF.
#[derive(Debug, Clone, PartialEq)]
pub struct Slack {
    learnt: OffsetMap,
    withheld: Withheld,
    limit: PlayLimit,
    part: SlackShare,
    /// How much of the friction is shared, 0 to 1.
    shared: f64,
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
            shared: 1.0,
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

    /// So much of it is left for this DOF.
    pub const fn set_slack_share(&mut self, part: SlackShare) {
        self.part = part;
    }

    /// The share of the width that is left.
    fn left(&self, part: f64) -> f64 {
        1.0 - self.shared * (1.0 - part)
    }

    /// Learn how much is shared from an offset in contact, by the steepest descent of
    ///
    /// ```text
    /// ((offset - middle) / half width - (1 - shared (1 - part)))^2
    /// ```
    ///
    /// as far as that is off by more than the share's deviation.
    fn share(&mut self, side: Side, position: f64, offset: f64) {
        let lost = 1.0 - self.part.now;
        let whole = self.learnt(position);
        let [minus, plus] = whole;
        if plus > minus && lost > 0.0 {
            let missing = (side.of(whole) - offset) / (side.of(whole) - f64::midpoint(minus, plus));
            let error = missing.clamp(0.0, 1.0) - self.shared * lost;
            let beyond = error - error.clamp(-self.part.deviation, self.part.deviation);
            self.shared = (self.shared + SHARING * lost * beyond).clamp(0.0, 1.0);
        }
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
        let doubt = self.shared * self.part.deviation * self.half_width(measured);
        let variance = variance + doubt * doubt;
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
            self.share(side, measured, offset);
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
