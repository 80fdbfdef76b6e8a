//! Limits of the command: the bounds of the law, checked by code and state that share nothing with it.

use crate::dof::{Friction, zip_with};
use crate::error::{ConfigError, require, require_positive};
use crate::math::linear::square;
use crate::supervision::settings::SafetySettings;

/// Share by which rounding may exceed the common bound of DOFs that share a friction.
const ROUNDING: f64 = 1e-9;
/// How far, in `width_limit`, rounding of a sum of reference and lead may do so.
const SUM_ROUNDING: f64 = 1e-14;

/// Limits the command of one DOF.
///
/// ```text
/// 0 <= dc / du <= gain_limit,   dc = 0 where du = 0,   |dc| <= command_speed period,
/// least <= c <= largest,   |c - u| <= width_limit
/// ```
///
/// A command that exceeds `command_speed` does not move: no operator input asks for it. A command outside of the last
/// two bounds, where another bound keeps it from entering at once, moves no farther out. The limited command is the
/// one that is sent, and the one from which the law continues.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CommandLimiter {
    gain_limit: f64,
    /// Largest |dc| in a tick.
    step_limit: f64,
    /// Least and largest command.
    travel: (f64, f64),
    /// Largest |c - u|.
    lead_limit: f64,
    /// Reference and command of the last tick.
    last: Option<(f64, f64)>,
}

/// What the limiter did to a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LimiterResult {
    /// The command was within all bounds and is unchanged, bit for bit.
    Unchanged,
    /// A limit of travel or speed changed the command: that share of the reference's motion has to be discarded, or
    /// the command would catch up later.
    Limited,
    /// The command exceeded `command_speed` and stays where it was.
    Jump,
    /// The command led the reference by more than `width_limit` and was kept at that distance. This takes from the
    /// compensation and not from the motion.
    LeadLimited,
    /// The command violated the law: the software is wrong.
    Violation,
}

impl CommandLimiter {
    fn check(&self) -> Result<(), ConfigError> {
        let (least, largest) = self.travel;
        let is_gain = self.gain_limit.is_finite() && self.gain_limit >= 1.0;
        require(is_gain, "gain_limit", self.gain_limit, "finite, 1 or above")?;
        require_positive("command_speed", self.step_limit)?;
        require_positive("width_limit", self.lead_limit)?;
        let is_ordered = least < largest && (largest - least).is_finite();
        let allowed = "finite, below the largest position";
        require(is_ordered, "command_travel", least, allowed)
    }

    /// The limited command for a gated reference; the law's bound is 0 <= dc / du <= `gain_limit`, or |dc| <= `reach`.
    ///
    /// Where reference or command is not finite, this is the last command, or NaN before the first.
    fn limit(&mut self, reference: f64, command: f64, reach: Option<f64>) -> (f64, LimiterResult) {
        use LimiterResult::{Jump, LeadLimited, Limited, Unchanged, Violation};
        let Self {
            gain_limit,
            step_limit,
            travel: (least, largest),
            lead_limit,
            last,
        } = *self;
        let Some((last_reference, last)) = last else {
            if !(reference.is_finite() && command.is_finite()) {
                return (f64::NAN, Violation);
            }
            let limited = command.max(least).min(largest);
            self.last = Some((reference, limited));
            let result = result(limited, command, Unchanged, Limited);
            return (limited, result);
        };
        if !reference.is_finite() {
            return (last, Violation);
        }
        let increment = reference - last_reference;
        let (low, high) = reach.map_or_else(
            || {
                let farthest = last + gain_limit * increment;
                (last.min(farthest), last.max(farthest))
            },
            |reach| (last - reach, last + reach),
        );
        let lawful = if command.is_finite() && low.is_finite() && high.is_finite() {
            command.max(low).min(high)
        } else {
            last
        };
        if (lawful - last).abs() > step_limit {
            self.last = Some((reference, last));
            let result = result(lawful, command, Jump, Violation);
            return (last, result);
        }
        // Never beyond the last command's own distance, so that a limit cannot move anything by itself.
        let ahead = (last - last_reference).max(lead_limit);
        let behind = (last - last_reference).min(-lead_limit);
        let led = lawful.max(reference + behind).min(reference + ahead);
        let limited = led
            .max(least.min(last))
            .min(largest.max(last))
            .max(last - step_limit)
            .min(last + step_limit);
        // Rounding of the bounds on c - u must not violate the law.
        let sent = limited.max(low).min(high);
        let sent = if sent.is_finite() { sent } else { last };
        let bound = result(limited, led, LeadLimited, Limited);
        let within_law = result(sent, command, Unchanged, bound);
        let result = result(lawful, command, within_law, Violation);
        self.last = Some((reference, sent));
        (sent, result)
    }
}

/// The limiters of N DOFs.
///
/// The motions of DOFs that share a friction are bounded together, as the vector law has it,
///
/// ```text
/// |dc| <= gain_limit |du|,   |x|^2 = sum of (x / unit)^2 over the DOFs of the group
/// ```
///
/// with `width_limit` as unit and the smallest of their gains: each may move with the reference of another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandLimiters<const N: usize> {
    dofs: [CommandLimiter; N],
    friction: Friction<N>,
}

impl<const N: usize> CommandLimiters<N> {
    /// The limiters before the first command, for the largest |dc| / |du| of each DOF and a control period in s.
    ///
    /// # Errors
    /// A limit or the period is not above 0, a `gain_limit` below 1, or the ends of a `command_travel` are not in order.
    pub fn new(
        safety: &SafetySettings<N>,
        gain_limit: [f64; N],
        period: f64,
        friction: Friction<N>,
    ) -> Result<Self, ConfigError> {
        require_positive("period", period)?;
        let mut limiters = gain_limit.map(|gain_limit| CommandLimiter {
            gain_limit,
            step_limit: period,
            travel: (f64::NAN, f64::NAN),
            lead_limit: f64::NAN,
            last: None,
        });
        let travels = safety.width_limit.into_iter().zip(safety.command_travel);
        let limits = safety.command_speed.into_iter().zip(travels);
        for (limiter, (speed, (width, travel))) in limiters.iter_mut().zip(limits) {
            limiter.step_limit *= speed;
            (limiter.lead_limit, limiter.travel) = (width, travel);
            limiter.check()?;
        }
        Ok(Self {
            dofs: limiters,
            friction,
        })
    }

    /// The limited commands (N,) for a gated reference (N,) [m or rad], and what was limited.
    pub fn limit(
        &mut self,
        reference: [f64; N],
        command: [f64; N],
    ) -> ([f64; N], [LimiterResult; N]) {
        let (mut commands, mut results) = (command, [LimiterResult::Unchanged; N]);
        for group in 0..N {
            let members = self.friction.members(group);
            self.limit_group(members, reference, &mut commands, &mut results);
        }
        (commands, results)
    }

    /// Continue from the commands (N,) that the actuators can follow, which are no farther than the limited ones.
    pub fn continue_from(&mut self, commands: [f64; N], results: &mut [LimiterResult; N]) {
        let dofs = self.dofs.iter_mut().zip(commands).zip(results);
        for ((limiter, command), found) in dofs {
            let Some((_, last)) = &mut limiter.last else {
                continue;
            };
            let changed = if *found == LimiterResult::Violation {
                LimiterResult::Violation
            } else {
                LimiterResult::Limited
            };
            *found = result(command, *last, *found, changed);
            *last = command;
        }
    }

    /// Limits the commands of the DOFs of a group.
    fn limit_group(
        &mut self,
        members: [bool; N],
        reference: [f64; N],
        commands: &mut [f64; N],
        results: &mut [LimiterResult; N],
    ) {
        let bound = self.common_bound(members, reference);
        let is_violated = bound.is_some_and(|bound| bound.length(*commands) > bound.reach);
        let dofs = self.dofs.iter_mut().zip(members).zip(reference);
        let outputs = commands.iter_mut().zip(results.iter_mut());
        for (((limiter, own), reference), (command, result)) in dofs.zip(outputs) {
            if own {
                let reach = bound.map(|bound| bound.reach * limiter.lead_limit);
                (*command, *result) = limiter.limit(reference, *command, reach);
            }
        }
        let has_changed = bound.is_some_and(|bound| bound.bring_back(commands));
        let dofs = self.dofs.iter_mut().zip(members).zip(reference);
        let outputs = commands.iter().zip(results);
        for (((limiter, own), reference), (command, result)) in dofs.zip(outputs) {
            if own && has_changed {
                limiter.last = Some((reference, *command));
            }
            if own && is_violated {
                *result = LimiterResult::Violation;
            } else if own && has_changed && *result == LimiterResult::Unchanged {
                *result = LimiterResult::LeadLimited;
            }
        }
    }

    /// The common bound of the DOFs of a group; None for a DOF by itself and before the first command.
    fn common_bound(&self, members: [bool; N], reference: [f64; N]) -> Option<CommonBound<N>> {
        if members.iter().filter(|own| **own).count() < 2 {
            return None;
        }
        let last = self.dofs.map(|limiter| limiter.last);
        let mut bound = CommonBound {
            members,
            unit: self.dofs.map(|limiter| limiter.lead_limit),
            last: last.map(|last| last.map_or(f64::NAN, |(_, command)| command)),
            motion: [0.0; N],
            gain: f64::INFINITY,
            reach: 0.0,
        };
        let motions = bound.motion.iter_mut().zip(members).zip(reference);
        for (((motion, own), reference), limiter) in motions.zip(&self.dofs) {
            if own {
                let (last, _) = limiter.last?;
                *motion = (reference - last) / limiter.lead_limit;
                bound.gain = bound.gain.min(limiter.gain_limit);
            }
        }
        let moved = libm::sqrt(dot(bound.motion, bound.motion));
        let rounding = if moved > 0.0 { SUM_ROUNDING } else { 0.0 };
        bound.reach = bound.gain * moved * (1.0 + ROUNDING) + rounding;
        Some(bound)
    }

    /// Moves the origin of the reference by `shift` (N,).
    pub fn shift_reference(&mut self, shift: [f64; N]) {
        for (limiter, shift) in self.dofs.iter_mut().zip(shift) {
            if let Some((reference, _)) = &mut limiter.last {
                *reference += shift;
            }
        }
    }
}

/// Common bound of the DOFs of a group in a tick. Motions are in `width_limit`, and 0 for the other DOFs.
#[derive(Debug, Clone, Copy)]
struct CommonBound<const N: usize> {
    members: [bool; N],
    unit: [f64; N],
    /// Last commands.
    last: [f64; N],
    /// Motion of the reference.
    motion: [f64; N],
    gain: f64,
    /// Largest length of the motion of the commands.
    reach: f64,
}

impl<const N: usize> CommonBound<N> {
    /// Brings commands beyond the bound back to it, towards the motion of the reference, which is within every limit of a
    /// DOF; whether there were such.
    fn bring_back(&self, commands: &mut [f64; N]) -> bool {
        let step = self.step(*commands);
        let bound = square(self.gain) * dot(self.motion, self.motion);
        if dot(step, step) <= square(self.reach) {
            return false;
        }
        // Between no motion and the command, as near to the motion of the reference as may be.
        let inner = zip_with(self.motion, step, |motion, step| {
            motion.max(step.min(0.0)).min(step.max(0.0))
        });
        let rest = zip_with(step, inner, |step, inner| step - inner);
        let (along, length) = (dot(inner, rest), dot(rest, rest));
        let left = bound - dot(inner, inner);
        let share = if left > 0.0 {
            left / (along + libm::sqrt(square(along) + length * left))
        } else {
            0.0
        };
        let bounded = zip_with(inner, rest, |inner, rest| inner + share.min(1.0) * rest);
        let bounded = zip_with(bounded, self.unit, |step, unit| unit * step);
        let dofs = commands.iter_mut().zip(self.members);
        for ((command, own), (last, step)) in dofs.zip(self.last.into_iter().zip(bounded)) {
            if own {
                *command = last + step;
            }
        }
        true
    }

    /// Motion of the commands since the last ones.
    fn step(&self, commands: [f64; N]) -> [f64; N] {
        let step = zip_with(commands, self.last, |command, last| command - last);
        let step = zip_with(step, self.unit, |step, unit| step / unit);
        zip_with(step, self.members, |step, own| if own { step } else { 0.0 })
    }

    fn length(&self, commands: [f64; N]) -> f64 {
        let step = self.step(commands);
        libm::sqrt(dot(step, step))
    }
}

fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `unchanged` if a bound has left the command as it was, bit for bit, else `changed`.
#[allow(clippy::float_cmp)]
fn result(
    bounded: f64,
    command: f64,
    unchanged: LimiterResult,
    changed: LimiterResult,
) -> LimiterResult {
    if bounded == command {
        unchanged
    } else {
        changed
    }
}
