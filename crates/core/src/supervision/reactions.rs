//! What is done about each flag: the table, and its words.

use crate::supervision::flags::Flag;

/// What the loop does about a flag; a later one wins over an earlier one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reaction {
    /// Goes on.
    None,
    /// R1: goes on, and says so until it is acknowledged.
    Warn,
    /// R2: compensates with the slack known; images teach nothing.
    HoldEstimate,
    /// R3: the same, and gives the compensation up with motion.
    Fade,
    /// R4: command increments are reference increments; what the command leads by stays.
    PassThrough,
    /// R5: the command rests; motion of the reference is thrown away.
    HoldMotion,
    /// R6: the same, and the rig brings its drives to quick stop.
    QuickStop,
    /// R7: the same, and the rig disables its drives.
    Disable,
}

/// What ends a reaction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clear {
    /// Enough good frames or ticks in a row.
    Auto,
    /// The operator re-engages.
    Engage,
    /// A new start of the loop.
    Restart,
}

/// Whose good events clear a flag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// A control tick.
    Tick,
    /// A frame.
    Frame,
    /// The rig; it does not say when all is well.
    Rig,
}

/// How a flag is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rule {
    /// The flag.
    pub flag: Flag,
    /// Whose good events clear it.
    pub source: Source,
    /// One answer after the other. A flag that is severe goes to the last at once.
    pub ladder: &'static [(Reaction, Clear)],
    /// Whether a flag that is raised again after `hold_time` or `hold_travel` on a rung climbs to the next.
    pub climbs: bool,
}

use Clear::{Auto, Engage, Restart};
use Reaction::{Disable, Fade, HoldEstimate, HoldMotion, PassThrough, QuickStop, Warn};
use Source::{Frame, Rig, Tick};

const HOLD_THEN_FADE: &[(Reaction, Clear)] = &[(HoldEstimate, Auto), (Fade, Auto)];
const WARN: &[(Reaction, Clear)] = &[(Warn, Auto)];

const fn rule(
    flag: Flag,
    source: Source,
    ladder: &'static [(Reaction, Clear)],
    climbs: bool,
) -> Rule {
    Rule {
        flag,
        source,
        ladder,
        climbs,
    }
}

/// Every flag's rule, in the order of the flags.
///
/// A frame without markers teaches nothing by itself, so `lost` need not hold before it fades; two markers
/// that leave a DOF undetermined hold it by themselves.
#[rustfmt::skip]
pub static TABLE: [Rule; 26] = [
    rule(Flag::Frozen,           Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Late,             Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Duplicate,        Frame, WARN,                                    false),
    rule(Flag::Dropped,          Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Clock,            Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Innovation,       Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Jump,             Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Slip,             Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Swapped,          Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Merged,           Frame, &[(Warn, Auto), (HoldEstimate, Auto), (Fade, Auto)], true),
    rule(Flag::Lost,             Frame, &[(Warn, Auto), (Fade, Auto)],           true),
    rule(Flag::Unobservable,     Frame, WARN,                                    false),
    rule(Flag::FollowingError,   Rig,   &[(QuickStop, Engage)],                  false),
    rule(Flag::ReferenceJump,    Tick,  &[(HoldMotion, Engage)],                 false),
    rule(Flag::ReferenceLate,    Tick,  &[(HoldMotion, Engage)],                 false),
    rule(Flag::ReferenceInvalid, Tick,  &[(HoldMotion, Engage)],                 false),
    rule(Flag::LateTick,         Tick,  &[(Warn, Auto), (HoldMotion, Engage)],   false),
    rule(Flag::DriveFault,       Rig,   &[(QuickStop, Engage), (Disable, Restart)], true),
    rule(Flag::StartCheck,       Rig,   &[(PassThrough, Engage)],                false),
    rule(Flag::WidthLimit,       Frame, WARN,                                    false),
    rule(Flag::Monitor,          Tick,  &[(Warn, Auto), (Disable, Restart)],     false),
    rule(Flag::CommandJump,      Tick,  &[(HoldMotion, Engage)],                 false),
    rule(Flag::Tremor,           Tick,  WARN,                                    false),
    rule(Flag::Overcompensation, Frame, WARN,                                    false),
    rule(Flag::LimitCycle,       Frame, &[(Fade, Auto)],                         false),
    rule(Flag::SlackChanged,     Frame, WARN,                                    false),
];
