//! Compensation law of profile `best`: the limited gain of Eq. (2) for DOFs that share a friction together.

use crate::article::play_limit::PlayLimit;
use crate::dof::{all_finite, zip_with};
use crate::error::{ConfigError, require, require_positive};
use crate::law::direction::Direction;
use crate::law::settings::LawSettings;
use crate::model::plays::{
    COEFFICIENTS, GAIN_ROW, OFFSET, OWN, Plays, Row, SHARED, Transmission, bent, product,
};
use crate::model::slack::Slack;

/// Share of `command_speed` that the law uses, so that rounding does not exceed it.
const BELOW_LIMIT: f64 = 0.999;
/// Length of a motion, in `width_limit`, below which it counts as rest: its square would underflow.
const REST: f64 = 1e-100;
/// Steps in search of the largest motion whose predicted tip is slow enough.
const STEPS: usize = 5;
/// Speed of the tip over the predicted one, at most that of the command: while few plays slide, a tip that is a single play
/// rests or moves like the command.
const EARLY: f64 = 2.0;
/// Distance from the origin, in units, at which a change of the gain counts as one of the tip.
const FAR: f64 = 2.0;
/// Travel of a DOF, in units, within which its coefficients in use may change faster: at the start they are not known, and
/// only the first reversal tells its slack.
const START: f64 = 7.0;
/// Largest rate at which the command's speed grows beyond the reference's, in `width_limit` / s^2: a tremor, which reverses
/// ten times a second, must not drive the motors across the slack each time.
pub(crate) const ACCELERATION: f64 = 40.0;
/// Motion that takes back compensation no longer in use, over that of the reference: the tip moves half as fast at least.
const WITHDRAWAL: f64 = 0.5;
/// Steps in which the command of a steady slide is found, and in which the model corrects it.
const SLIDES: usize = 3;
const CORRECTIONS: usize = 3;
/// Distance in units by which limits of the contact offsets move the target from which on they count.
const HARM: f64 = 0.1;
/// Largest correction of the target by the model, in units.
const LARGEST_CORRECTION: f64 = 0.2;

/// Vector law of limited gain for N DOFs.
///
/// With the reference u, the command c, the estimated coefficients, the direction w of the operator's motion, and norms over
/// the DOFs of a friction group in units of each,
///
/// ```text
/// steady    c0: the tip is at u while all plays slide along w
/// target    c* = c0, then three times c* += (u - tip(c*)) / gain, within 0.2 of c0
/// command   dc towards c* - c,   |dc| <= K_b |du|,   dc . du >= 0,   each |dc| <= command_speed period,
///           |dc| - |du| <= n (v + n ACCELERATION period^2),   v <- (|dc| - |du|) / n, 0 when w reverses
/// contact   max(|dq|, min(2 |dq|, |dc|)) <= tip_gain |du| for the predicted tip q, and q does not pass u along du
/// in use    coefficients follow the estimated ones, contact offsets and q by at most rate |du|:
///           rate = change_rate (1 + (START / travel)^2) / ratio^2,   travel of a DOF, from its first reversal anew
/// ```
///
/// with the ticks n since the reference moved last, 1 after a rest of more than `input_age`: an input device may be slower
/// than the loop. Birge's ratio is that of the last images: images that do not fit change little.
/// The steady command alone leaves the tip off the reference, because direction and plays keep turning. One DOF alone:
/// 0 <= dc / du <= `K_b`, Eq. (2). Where all DOFs of a group rest, no command moves, but each moves where another does: while
/// rotation turns, the friction that held the insertion is released.
/// With a share s of the compensation the command is s dc + (1 - s) (du + r), where the motion r takes back what the command has
/// beyond the reference, |r| <= min(WITHDRAWAL, `K_b` - 1) |du|: without compensation it is the reference in the end.
///
/// Wrong as far as the estimate is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VectorLaw<const N: usize> {
    settings: LawSettings,
    transmission: Transmission<N>,
    /// Unit over `width_limit`: the bounds compare DOFs in `width_limit`, as the limiter of the command does.
    weight: [f64; N],
    /// Largest |dc| in a tick.
    step_limit: [f64; N],
    /// Most by which |dc| - |du| grows in a tick.
    growth: f64,
    /// |dc| - |du| of each DOF's group per tick when it moved last, 0 or above.
    surplus: [f64; N],
    /// Ticks since each DOF's group moved last.
    rested: [f64; N],
    /// Most of these in which a slow input device still moves.
    most_rested: f64,
    limits: [PlayLimit; N],
    direction: Direction<N>,
    reference: Option<[f64; N]>,
    /// Command less reference.
    lead: [f64; N],
    /// The command c (N,) [m or rad]; NaN before the first reference.
    pub command: [f64; N],
    /// The plays that follow the command.
    pub plays: Plays<N>,
    /// First reference (N,) [m or rad]; NaN before it.
    pub origin: [f64; N],
    /// Command at which the tip is at the reference, in units.
    target: [f64; N],
    /// Travel of the reference, in units, since the start or the first reversal.
    travel: [f64; N],
    has_turned: [bool; N],
    /// Coefficients in use, and the slack that they make.
    rows: [Row; N],
    slack: [Slack; N],
    /// Share of the compensation in use: all with 1, none with 0. A change is bumpless.
    pub share: f64,
    /// Whether the limits of the contact offsets keep the tip from the reference by more than a tenth of a unit.
    pub is_limited: bool,
}

/// Bounds of the law for N DOFs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds<const N: usize> {
    /// Largest slack that is compensated [m or rad], in which the bounds compare DOFs.
    pub width_limit: [f64; N],
    /// Largest |dc| / period [m/s or rad/s].
    pub speed: [f64; N],
    /// Control period [s].
    pub period: f64,
    /// Longest time between two values of a moving input device [s].
    pub input_age: f64,
    /// Limits of the contact offsets.
    pub offsets: [PlayLimit; N],
}

impl<const N: usize> VectorLaw<N> {
    /// The law before the first reference.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        settings: LawSettings,
        transmission: Transmission<N>,
        bounds: &Bounds<N>,
    ) -> Result<Self, ConfigError> {
        let gain = settings.free_gain;
        let is_gain = gain.is_finite() && gain >= 1.0;
        require(is_gain, "free_gain", gain, "finite, 1 or above")?;
        let tip_gain = settings.tip_gain;
        require(tip_gain >= 1.0, "tip_gain", tip_gain, "1 or above")?;
        require_positive("direction_travel", settings.direction_travel)?;
        require_positive("change_rate", settings.change_rate)?;
        let friction = *transmission.friction();
        Ok(Self {
            settings,
            weight: over(transmission.unit(), bounds.width_limit),
            step_limit: bounds
                .speed
                .map(|speed| speed * bounds.period * BELOW_LIMIT),
            growth: ACCELERATION * bounds.period * bounds.period,
            surplus: [0.0; N],
            rested: [0.0; N],
            most_rested: bounds.input_age / bounds.period,
            limits: bounds.offsets,
            direction: Direction::new(friction, transmission.unit(), settings.direction_travel),
            transmission,
            reference: None,
            lead: [0.0; N],
            command: [f64::NAN; N],
            plays: Plays::REST,
            origin: [f64::NAN; N],
            target: [0.0; N],
            travel: [0.0; N],
            has_turned: [false; N],
            rows: [[0.0; COEFFICIENTS]; N],
            slack: [Slack::default(); N],
            share: 1.0,
            is_limited: false,
        })
    }

    /// Moves plays by a motion to a command (N,) [m or rad].
    pub fn follow(&self, plays: &mut Plays<N>, command: [f64; N]) {
        let to = over(subtract(command, self.origin), self.transmission.unit());
        self.transmission.advance(plays, &to);
    }

    /// The command for the next reference (N,) [m or rad], for the estimated coefficients and Birge's ratio of the last images.
    ///
    /// The first reference is passed through. A reference that is not finite moves nothing.
    pub fn propose(&mut self, reference: [f64; N], rows: &[Row; N], ratio: f64) -> [f64; N] {
        if !all_finite(reference) {
            return self.command;
        }
        let Some(last) = self.reference.replace(reference) else {
            self.rows = *rows;
            self.slack = self.transmission.slack(rows);
            return reference;
        };
        let motion = subtract(reference, last);
        self.rested = self.rested.map(|ticks| ticks + 1.0);
        if motion.iter().all(|motion| *motion == 0.0) {
            return self.command;
        }
        let before = self.direction.value();
        self.direction.step(motion);
        let direction = self.direction.value();
        self.follow_estimate(rows, motion, ratio);
        let unit = self.transmission.unit();
        let relative = over(subtract(reference, self.origin), unit);
        let moved = over(motion, unit);
        let target = self.next_target(relative);
        self.target = self.within_limits(target, relative);
        let taken = subtract(target, self.target);
        self.is_limited = taken.iter().any(|taken| taken.abs() > HARM);
        let friction = self.transmission.friction();
        // Of DOFs that share a friction the direction may turn without a reversal of the whole.
        let own = zip_with(before, direction, |a, b| a * b);
        let turn = friction.sum(own);
        let starts = self.travel.iter_mut().zip(&mut self.has_turned);
        for ((travel, has_turned), own) in starts.zip(own) {
            if own < 0.0 && !*has_turned {
                (*travel, *has_turned) = (0.0, true);
            }
        }
        self.surplus = zip_with(
            self.surplus,
            turn,
            |surplus, turn| {
                if turn < 0.0 { 0.0 } else { surplus }
            },
        );
        let length = self.norm(moved);
        let ticks = self.input_ticks();
        let step = self.bounded_step(relative, moved, length, ticks);
        let taken = zip_with(self.norm(step), length, |step, own| (step - own).max(0.0));
        let (mut command, gain) = (self.command, self.settings.free_gain);
        // Without gain there is no compensation.
        let share = if gain > 1.0 { self.share } else { 0.0 };
        let back = if share < 1.0 {
            self.withdrawal(motion, length)
        } else {
            [0.0; N]
        };
        let states = self.surplus.iter_mut().zip(&mut self.rested).zip(ticks);
        let dofs = command.iter_mut().zip(states);
        let dofs = dofs.zip(taken).zip(length).zip(self.transmission.dofs());
        let parts = reference.into_iter().zip(self.lead).zip(motion);
        let parts = parts.zip(step).zip(back);
        for (((((command, state), taken), length), dof), parts) in dofs.zip(parts) {
            if length < REST {
                continue;
            }
            let ((((reference, lead), motion), step), back) = parts;
            let before = *command;
            let ((surplus, rested), ticks) = state;
            (*surplus, *rested) = (taken / ticks, 0.0);
            *command = reference + lead + share * (step * dof.unit - motion) + (1.0 - share) * back;
            if dof.is_alone {
                // Eq. (2), to the last bit.
                let farthest = before + gain * motion;
                *command = command.max(before.min(farthest)).min(before.max(farthest));
            }
        }
        command
    }

    /// Continues from the command that was sent (N,) [m or rad].
    pub fn commit(&mut self, command: [f64; N]) {
        if !all_finite(command) {
            return;
        }
        if self.origin.iter().any(|origin| origin.is_nan()) {
            self.origin = self.reference.unwrap_or(command);
        }
        self.command = command;
        if let Some(reference) = self.reference {
            self.lead = subtract(command, reference);
        }
        let to = over(subtract(command, self.origin), self.transmission.unit());
        self.transmission.advance(&mut self.plays, &to);
    }

    /// Moves the coefficients in use towards the estimated ones, as far as contact offsets, gain and predicted tip may change in
    /// this motion: wrong images move little, and right ones can take back what they did.
    fn follow_estimate(&mut self, rows: &[Row; N], motion: [f64; N], ratio: f64) {
        let moved = over(motion.map(f64::abs), self.transmission.unit());
        let travel: f64 = moved.iter().sum();
        self.travel = zip_with(self.travel, moved, |sum, own| sum + own);
        if self.rows == *rows {
            return;
        }
        let dofs = self.transmission.dofs().iter();
        let dofs = dofs.zip(self.plays.regressors()).zip(self.travel);
        for ((used, estimated), ((dof, phi), own)) in self.rows.iter_mut().zip(rows).zip(dofs) {
            let deflection = dof.deflection(estimated, 1.0) - dof.deflection(used, 1.0);
            let tip = product(&phi, estimated) - product(&phi, used);
            let steeper = product(&GAIN_ROW, estimated) - product(&GAIN_ROW, used);
            let change = (deflection.abs().max(tip.abs())).max(FAR * steeper.abs());
            let known = START / own;
            let rate = self.settings.change_rate * (1.0 + known * known);
            // Without a change this is infinite or NaN, of which `min` makes 1.
            let share = (rate * travel / (change * ratio * ratio)).min(1.0);
            for (used, new) in used.iter_mut().zip(estimated) {
                *used += share * (new - *used);
            }
        }
        self.slack = self.transmission.slack(&self.rows);
    }

    /// The target for a reference (N,) in units.
    fn next_target(&self, reference: [f64; N]) -> [f64; N] {
        let direction = self.direction.value();
        let mut steady = self.target;
        let dofs = self
            .transmission
            .dofs()
            .iter()
            .zip(&self.rows)
            .zip(&self.slack);
        let given = reference.into_iter().zip(direction);
        let dofs = steady.iter_mut().zip(dofs).zip(given);
        for ((to, ((dof, row), slack)), (reference, direction)) in dofs {
            let deflection = dof.deflection(row, direction);
            let linear = product(&[1.0; SHARED + OWN], row);
            let constant = row.get(OFFSET).copied().unwrap_or(0.0);
            for _ in 0..SLIDES {
                let tip = linear * *to - deflection + bent(row, *to, direction) + constant;
                *to += (reference - tip) / slack.gain;
            }
            *to = to.max(reference - 2.0).min(reference + 2.0);
        }
        let mut target = steady;
        for _ in 0..CORRECTIONS {
            let mut ahead = self.plays;
            self.transmission.advance(&mut ahead, &target);
            let tip = ahead.tip(&self.rows);
            let dofs = target
                .iter_mut()
                .zip(steady)
                .zip(reference.into_iter().zip(tip))
                .zip(&self.slack);
            for (((to, steady), (reference, tip)), slack) in dofs {
                *to += (reference - tip) / slack.gain;
                *to = to
                    .max(steady - LARGEST_CORRECTION)
                    .min(steady + LARGEST_CORRECTION);
            }
        }
        target
    }

    /// The target with contact offsets within their limits.
    fn within_limits(&self, mut target: [f64; N], reference: [f64; N]) -> [f64; N] {
        let dofs = target.iter_mut().zip(reference).zip(&self.slack);
        let dofs = dofs.zip(self.limits);
        for ((((to, reference), slack), limit), unit) in dofs.zip(self.transmission.unit()) {
            let [minus, plus] = slack.offsets();
            if limit.exceeds(minus, plus) {
                let [minus, plus] = limit.clamp(minus, plus);
                let middle = reference / slack.gain;
                *to = to.max(middle + minus / unit).min(middle + plus / unit);
            }
        }
        target
    }

    /// For each DOF the product of two motions (N,) of its group, which are in units, in `width_limit`.
    fn dot(&self, a: [f64; N], b: [f64; N]) -> [f64; N] {
        let scaled = |values| zip_with(values, self.weight, |value, weight| weight * value);
        let products = zip_with(scaled(a), scaled(b), |a, b| a * b);
        self.transmission.friction().sum(products)
    }

    /// For each DOF the length of a motion (N,) of its group, which is in units, in `width_limit`.
    fn norm(&self, motion: [f64; N]) -> [f64; N] {
        self.dot(motion, motion).map(libm::sqrt)
    }

    /// What takes back the lead (N,) [m or rad] in a motion of the reference (N,), with the lengths (N,) of its groups.
    fn withdrawal(&self, motion: [f64; N], lengths: [f64; N]) -> [f64; N] {
        let most = WITHDRAWAL.min(self.settings.free_gain - 1.0);
        let lead = self.norm(over(self.lead, self.transmission.unit()));
        let share = zip_with(lengths, lead, |moved, lead| (most * moved / lead).min(1.0));
        let back = zip_with(self.lead, share, |lead, share| -lead * share);
        let fastest = zip_with(self.step_limit, motion, |limit, motion| {
            limit.max(motion.abs())
        });
        let whole = zip_with(motion, back, |motion, back| motion + back);
        let whole = zip_with(whole, fastest, |whole, most| whole.max(-most).min(most));
        subtract(whole, motion)
    }

    /// For each DOF's group the ticks (N,) in which its reference has come to its next value: of a slow device several.
    fn input_ticks(&self) -> [f64; N] {
        self.rested.map(|ticks| {
            if ticks <= self.most_rested {
                ticks
            } else {
                1.0
            }
        })
    }

    /// The motion of the commands towards the target, within the bounds of each group, for a reference and its motion (N,), all
    /// in units; `moved` (N,) are the lengths of the motion, `ticks` the time that it took. A group that rests does not move.
    fn bounded_step(
        &self,
        reference: [f64; N],
        motion: [f64; N],
        moved: [f64; N],
        ticks: [f64; N],
    ) -> [f64; N] {
        let mut step = subtract(self.target, self.plays.command);
        let against = self.dot(step, motion);
        let dofs = step.iter_mut().zip(motion).zip(moved).zip(against);
        for (((step, motion), moved), along) in dofs {
            // Never against the reference.
            let against = along.min(0.0) / (moved * moved);
            *step = if moved < REST {
                0.0
            } else {
                *step - against * motion
            };
        }
        let length = self.norm(step);
        let mut share = self.step_limit;
        for ((share, step), unit) in share.iter_mut().zip(step).zip(self.transmission.unit()) {
            *share /= step.abs() * unit;
        }
        share = self
            .transmission
            .friction()
            .over_group(share, 1.0, f64::min);
        let surplus = zip_with(self.surplus, ticks, |surplus, ticks| {
            ticks * (ticks * self.growth + surplus)
        });
        let bounds = share.iter_mut().zip(surplus).zip(moved).zip(length);
        for (((share, surplus), moved), length) in bounds {
            let fastest = (self.settings.free_gain * moved).min(moved + surplus);
            *share = share.min(fastest / length);
        }
        let now = self.plays.tip(&self.rows);
        let gap = self.dot(subtract(reference, now), motion);
        let room = zip_with(
            moved,
            zip_with(gap, moved, |gap, moved| gap / moved),
            f64::max,
        );
        for _ in 0..STEPS {
            let part = zip_with(share, step, |share, step| share * step);
            let to = zip_with(self.plays.command, part, |from, part| from + part);
            let mut there = self.plays;
            self.transmission.advance(&mut there, &to);
            let change = subtract(there.tip(&self.rows), now);
            let (tip, along) = (self.norm(change), self.dot(change, motion));
            let mut is_within = true;
            let groups = share
                .iter_mut()
                .zip(length)
                .zip(moved.into_iter().zip(room));
            for (((share, length), (moved, room)), (tip, along)) in
                groups.zip(tip.into_iter().zip(along))
            {
                let fastest = tip.max((EARLY * tip).min(*share * length));
                let excess =
                    (fastest / (self.settings.tip_gain * moved)).max(along / (moved * room));
                if excess > 1.0 {
                    *share *= (1.0 / excess).max(0.2);
                    is_within = false;
                }
            }
            if is_within {
                break;
            }
        }
        zip_with(share, step, |share, step| share * step)
    }

    /// Counts the reference from elsewhere by `shift` (N,); the command stays.
    pub fn shift_reference(&mut self, shift: [f64; N]) {
        if let Some(reference) = &mut self.reference {
            *reference = zip_with(*reference, shift, |reference, shift| reference + shift);
            self.lead = subtract(self.lead, shift);
        }
    }
}

fn subtract<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    zip_with(a, b, |a, b| a - b)
}

fn over<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    zip_with(a, b, |a, b| a / b)
}
