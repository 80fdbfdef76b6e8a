//! Limits of the command: the bounds of the law, checked by code and state that share nothing with it.

use crate::dof::PerDof;
use crate::error::{ConfigError, require, require_positive};
use crate::math::linear::square;
use crate::settings::DofSettings;
use crate::supervision::settings::SafetySettings;

/// Share by which rounding may exceed the common bound of insertion and rotation.
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
pub struct CommandLimiter {
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
    /// The limiter of DOF number `index` before the first command, for a control period in s.
    ///
    /// # Errors
    /// A limit is not above 0, `gain_limit` is below 1, or the ends of `command_travel` are not in order.
    pub fn new(
        safety: &SafetySettings,
        dof: &DofSettings,
        index: usize,
        period: f64,
    ) -> Result<Self, ConfigError> {
        let gain_limit = dof.gain_limit;
        let is_gain = gain_limit.is_finite() && gain_limit >= 1.0;
        require(is_gain, "gain_limit", gain_limit, "finite, 1 or above")?;
        let of = |values: [f64; 3]| values.get(index).copied().unwrap_or(f64::NAN);
        let step_limit = of(safety.command_speed) * period;
        require_positive("command_speed", step_limit)?;
        let lead_limit = of(safety.width_limit);
        require_positive("width_limit", lead_limit)?;
        let least = of(safety.command_travel.map(|(least, _)| least));
        let largest = of(safety.command_travel.map(|(_, largest)| largest));
        let is_ordered = least < largest && (largest - least).is_finite();
        require(
            is_ordered,
            "command_travel",
            least,
            "finite, below the largest position",
        )?;
        Ok(Self {
            gain_limit,
            step_limit,
            travel: (least, largest),
            lead_limit,
            last: None,
        })
    }

    /// The limited command for a gated reference; the law's bound is 0 <= dc / du <= `gain_limit`, or |dc| <= `reach`.
    ///
    /// Where reference or command is not finite, this is the last command, or NaN before the first.
    pub fn limit(
        &mut self,
        reference: f64,
        command: f64,
        reach: Option<f64>,
    ) -> (f64, LimiterResult) {
        let Self {
            gain_limit,
            step_limit,
            travel: (least, largest),
            lead_limit,
            last,
        } = *self;
        let Some((last_reference, last)) = last else {
            if !(reference.is_finite() && command.is_finite()) {
                return (f64::NAN, LimiterResult::Violation);
            }
            let limited = command.max(least).min(largest);
            self.last = Some((reference, limited));
            let result = result(
                limited,
                command,
                LimiterResult::Unchanged,
                LimiterResult::Limited,
            );
            return (limited, result);
        };
        if !reference.is_finite() {
            return (last, LimiterResult::Violation);
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
            let result = result(
                lawful,
                command,
                LimiterResult::Jump,
                LimiterResult::Violation,
            );
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
        let bound = result(
            limited,
            led,
            LimiterResult::LeadLimited,
            LimiterResult::Limited,
        );
        let within_law = result(sent, command, LimiterResult::Unchanged, bound);
        let result = result(lawful, command, within_law, LimiterResult::Violation);
        self.last = Some((reference, sent));
        (sent, result)
    }

    /// Motion of reference and command since the last tick; None before the first.
    fn motion(&self, reference: f64, command: f64) -> Option<(f64, f64)> {
        let (last_reference, last) = self.last?;
        Some((reference - last_reference, command - last))
    }

    /// Moves the origin of the reference by `shift`.
    pub fn shift_reference(&mut self, shift: f64) {
        if let Some((reference, _)) = &mut self.last {
            *reference += shift;
        }
    }
}

/// The limiters of the three DOFs.
///
/// Where insertion and rotation are `coupled`, their motions are bounded together, as the vector law has it,
///
/// ```text
/// |dc| <= gain_limit |du|,   |x|^2 = (x1 / unit1)^2 + (x2 / unit2)^2
/// ```
///
/// with `width_limit` as unit and the smaller of both gains: each may move with the reference of the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandLimiters {
    dofs: PerDof<CommandLimiter>,
    is_coupled: bool,
}

impl CommandLimiters {
    /// As [`CommandLimiter::new`], for each DOF.
    ///
    /// # Errors
    /// As [`CommandLimiter::new`].
    pub fn new(
        safety: &SafetySettings,
        [first, second, third]: &PerDof<DofSettings>,
        period: f64,
        is_coupled: bool,
    ) -> Result<Self, ConfigError> {
        Ok(Self {
            dofs: [
                CommandLimiter::new(safety, first, 0, period)?,
                CommandLimiter::new(safety, second, 1, period)?,
                CommandLimiter::new(safety, third, 2, period)?,
            ],
            is_coupled,
        })
    }

    /// The limited commands (3,) for a gated reference (3,) [m, rad, rad], and what was limited.
    pub fn limit(
        &mut self,
        reference: PerDof<f64>,
        command: PerDof<f64>,
    ) -> (PerDof<f64>, PerDof<LimiterResult>) {
        let ([u1, u2, u3], [c1, c2, c3]) = (reference, command);
        let ([c1, c2], [reach1, reach2], is_violated) = self.couple([u1, u2], [c1, c2]);
        let [first, second, third] = &mut self.dofs;
        let before = [first.last, second.last];
        let (limited1, result1) = first.limit(u1, c1, reach1);
        let (limited2, result2) = second.limit(u2, c2, reach2);
        let (limited3, result3) = third.limit(u3, c3, None);
        let ([limited1, limited2], has_changed) =
            self.couple_again(before, [u1, u2], [limited1, limited2]);
        let shaft = [result1, result2].map(|result| {
            if is_violated {
                LimiterResult::Violation
            } else if has_changed && result == LimiterResult::Unchanged {
                LimiterResult::LeadLimited
            } else {
                result
            }
        });
        let [result1, result2] = shaft;
        ([limited1, limited2, limited3], [result1, result2, result3])
    }

    /// Commands of insertion and rotation within their common bound, how far each may move, and whether they were not.
    fn couple(&self, [u1, u2]: [f64; 2], [c1, c2]: [f64; 2]) -> ([f64; 2], [Option<f64>; 2], bool) {
        let [first, second, _] = &self.dofs;
        let (Some((du1, dc1)), Some((du2, dc2)), true) =
            (first.motion(u1, c1), second.motion(u2, c2), self.is_coupled)
        else {
            return ([c1, c2], [None; 2], false);
        };
        let (unit1, unit2) = (first.lead_limit, second.lead_limit);
        let norm = |x: f64, y: f64| libm::sqrt(square(x / unit1) + square(y / unit2));
        let moved = norm(du1, du2);
        let rounding = if moved > 0.0 { SUM_ROUNDING } else { 0.0 };
        let gain = first.gain_limit.min(second.gain_limit);
        let reach = gain * moved * (1.0 + ROUNDING) + rounding;
        let length = norm(dc1, dc2);
        let reaches = [Some(reach * unit1), Some(reach * unit2)];
        if length.is_nan() || length <= reach {
            return ([c1, c2], reaches, false);
        }
        let kept = reach / length;
        let commands = [c1 - (1.0 - kept) * dc1, c2 - (1.0 - kept) * dc2];
        (commands, reaches, true)
    }

    /// Commands of insertion and rotation that their own limits have moved beyond the common bound, and whether there
    /// were such: brought back to it towards the motion of the reference, which is within every limit of a DOF.
    fn couple_again(
        &mut self,
        before: [Option<(f64, f64)>; 2],
        reference: [f64; 2],
        command: [f64; 2],
    ) -> ([f64; 2], bool) {
        let [first, second, _] = &mut self.dofs;
        let ([Some((l1, b1)), Some((l2, b2))], true) = (before, self.is_coupled) else {
            return (command, false);
        };
        let ([u1, u2], [c1, c2]) = (reference, command);
        let units = [first.lead_limit, second.lead_limit];
        let [unit1, unit2] = units;
        let (du, dc) = (
            [(u1 - l1) / unit1, (u2 - l2) / unit2],
            [(c1 - b1) / unit1, (c2 - b2) / unit2],
        );
        let product = |[a, b]: [f64; 2], [c, d]: [f64; 2]| a * c + b * d;
        let gain = first.gain_limit.min(second.gain_limit);
        let bound = square(gain) * product(du, du);
        let exceeds = product(dc, dc) > bound * square(1.0 + ROUNDING) + square(SUM_ROUNDING);
        if !exceeds {
            return (command, false);
        }
        // Between no motion and the command, as near to the motion of the reference as may be.
        let mut inner = du;
        let mut rest = dc;
        for ((inner, rest), dc) in inner.iter_mut().zip(&mut rest).zip(dc) {
            *inner = inner.max(dc.min(0.0)).min(dc.max(0.0));
            *rest -= *inner;
        }
        let (along, length) = (product(inner, rest), product(rest, rest));
        let left = (bound - product(inner, inner)).max(0.0);
        let share = left / (along + libm::sqrt(square(along) + length * left));
        let share = share.clamp(0.0, 1.0);
        let ([i1, i2], [r1, r2]) = (inner, rest);
        let bounded = [
            b1 + unit1 * (i1 + share * r1),
            b2 + unit2 * (i2 + share * r2),
        ];
        for (limiter, (reference, command)) in [first, second]
            .into_iter()
            .zip(reference.into_iter().zip(bounded))
        {
            limiter.last = Some((reference, command));
        }
        (bounded, true)
    }

    /// Moves the origin of the reference by `shift` (3,).
    pub fn shift_reference(&mut self, shift: PerDof<f64>) {
        for (limiter, shift) in self.dofs.iter_mut().zip(shift) {
            limiter.shift_reference(shift);
        }
    }
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
