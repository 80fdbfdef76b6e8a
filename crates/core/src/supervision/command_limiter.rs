//! The last word on a command: the law's bounds once more, by code and state that share nothing with it.

use crate::error::{ConfigError, require, require_positive};

/// What no command may do; one DOF, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandLimits {
    /// Largest dc / du.
    pub gain_limit: f64,
    /// Largest |dc| in a tick.
    pub step_limit: f64,
    /// Least and largest command.
    pub travel: (f64, f64),
    /// Largest |c - u|.
    pub lead_limit: f64,
}

/// Watches one DOF.
///
/// ```text
/// 0 <= dc / du <= gain_limit,   dc = 0 where du = 0,   |dc| <= step_limit,
/// least <= c <= largest,   |c - u| <= lead_limit
/// ```
///
/// A command that breaks the third is no hand's, whatever the clutch before the law made of it: it does not move. One
/// outside of the last two, which another bound keeps it from entering at once, comes no farther out. What is permitted is what is sent, and what the law goes on from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandLimiter {
    settings: CommandLimits,
    last: Option<(f64, f64)>,
}

/// What became of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LimiterResult {
    /// It was within all bounds and is what it was, bit for bit.
    Same,
    /// A limit of travel changed it: that share of the reference's motion is to be thrown away, or the command would
    /// make up for it later.
    Limited,
    /// It would have changed faster than any hand asks for, and stays where it is.
    Jump,
    /// It led the reference too far and was kept at its side. That takes from the compensation and not from the motion.
    Led,
    /// It broke the law: the software is wrong.
    Broken,
}

impl CommandLimiter {
    /// Before the first command.
    ///
    /// # Errors
    /// A limit is not above 0, the gain's below 1, or the travel's ends are not in order.
    pub fn new(settings: CommandLimits) -> Result<Self, ConfigError> {
        let gain = settings.gain_limit.is_finite() && settings.gain_limit >= 1.0;
        require(
            gain,
            "gain_limit",
            settings.gain_limit,
            "finite, 1 or above",
        )?;
        require_positive("command_speed", settings.step_limit)?;
        require_positive("lead_limit", settings.lead_limit)?;
        let (least, largest) = settings.travel;
        let ordered = least < largest && (largest - least).is_finite();
        require(
            ordered,
            "travel",
            least,
            "finite, below the largest position",
        )?;
        Ok(Self {
            settings,
            last: None,
        })
    }

    /// The command that may be sent for an admitted reference.
    ///
    /// One that is not finite, or of a reference that is not, becomes the last, or NaN before there is one.
    pub fn permit(&mut self, reference: f64, command: f64) -> (f64, LimiterResult) {
        let CommandLimits {
            gain_limit,
            step_limit,
            travel: (least, largest),
            lead_limit,
        } = self.settings;
        let Some((last_reference, last)) = self.last else {
            if !(reference.is_finite() && command.is_finite()) {
                return (f64::NAN, LimiterResult::Broken);
            }
            let permitted = command.max(least).min(largest);
            self.last = Some((reference, permitted));
            let verdict = told(
                permitted,
                command,
                LimiterResult::Same,
                LimiterResult::Limited,
            );
            return (permitted, verdict);
        };
        if !reference.is_finite() {
            return (last, LimiterResult::Broken);
        }
        let increment = reference - last_reference;
        let farthest = last + gain_limit * increment;
        let lawful = if command.is_finite() && farthest.is_finite() {
            command.max(last.min(farthest)).min(last.max(farthest))
        } else {
            last
        };
        if (lawful - last).abs() > step_limit {
            self.last = Some((reference, last));
            return (
                last,
                told(lawful, command, LimiterResult::Jump, LimiterResult::Broken),
            );
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
        // Rounding of the lead's bounds may not break the law.
        let permitted = limited.max(last.min(farthest)).min(last.max(farthest));
        let permitted = if permitted.is_finite() {
            permitted
        } else {
            last
        };
        let bound = told(limited, led, LimiterResult::Led, LimiterResult::Limited);
        let lawfully = told(permitted, command, LimiterResult::Same, bound);
        let verdict = told(lawful, command, lawfully, LimiterResult::Broken);
        self.last = Some((reference, permitted));
        (permitted, verdict)
    }

    /// The reference is from now on counted from elsewhere.
    pub fn shift(&mut self, shift: f64) {
        if let Some((reference, _)) = &mut self.last {
            *reference += shift;
        }
    }
}

/// A verdict is told bit for bit: one if a bound has left a command what it was, the other if not.
#[allow(clippy::float_cmp)]
fn told(bounded: f64, command: f64, left: LimiterResult, changed: LimiterResult) -> LimiterResult {
    if bounded == command { left } else { changed }
}
