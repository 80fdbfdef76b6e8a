//! The reaction to each flag.

use crate::supervision::flags::Flag;

/// What the loop does while a flag is active; a later reaction has priority over an earlier one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reaction {
    /// Continue.
    None,
    /// R1: continue, with a warning until it is acknowledged.
    Warn,
    /// R2: compensate with the slack estimated so far; images update nothing.
    HoldEstimate,
    /// R3: as R2, and reduce the compensation to nothing with motion.
    Fade,
    /// R4: no compensation: the command moves as the reference does, in `paper` at a constant difference, which `best` gives
    /// back with motion.
    PassThrough,
    /// R5: hold the command; motion of the reference is discarded.
    HoldMotion,
    /// R6: as R5, and the rig brings its drives to quick stop.
    QuickStop,
    /// R7: as R5, and the rig disables its drives.
    Disable,
}

/// What clears a flag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clear {
    /// Enough good frames or ticks in a row.
    Auto,
    /// The operator re-engages.
    Engage,
    /// A new start of the loop.
    Restart,
}

/// Where an event comes from; good events of a flag's source clear it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// A control tick.
    Tick,
    /// A frame.
    Frame,
    /// The rig, which does not report good events.
    Rig,
}

/// The reactions to a flag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rule {
    /// The flag.
    pub flag: Flag,
    /// The source whose good events clear it.
    pub source: Source,
    /// Reactions in the order of escalation, and what clears the flag at each. A severe flag goes to the last at once.
    pub levels: &'static [(Reaction, Clear)],
    /// Whether a flag that is raised again after `hold_time` or `hold_travel` at a level goes to the next.
    pub escalates: bool,
}

use Clear::{Auto, Engage, Restart};
use Reaction::{Disable, Fade, HoldEstimate, HoldMotion, PassThrough, QuickStop, Warn};
use Source::{Frame, Rig, Tick};

const HOLD_THEN_FADE: &[(Reaction, Clear)] = &[(HoldEstimate, Auto), (Fade, Auto)];
const WARN: &[(Reaction, Clear)] = &[(Warn, Auto)];
const WARN_THEN_FADE: &[(Reaction, Clear)] = &[(Warn, Auto), (Fade, Auto)];

const fn rule(
    flag: Flag,
    source: Source,
    levels: &'static [(Reaction, Clear)],
    escalates: bool,
) -> Rule {
    Rule {
        flag,
        source,
        levels,
        escalates,
    }
}

/// The rule of every flag, in the order of the flags.
///
/// `lost` fades without a hold because a frame without markers updates nothing in any case; `unobservable` needs no hold
/// because the state estimation holds a DOF that the markers do not determine.
#[rustfmt::skip]
pub static TABLE: [Rule; 27] = [
    rule(Flag::Frozen,           Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Late,             Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Duplicate,        Frame, WARN,                                    false),
    rule(Flag::Dropped,          Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Clock,            Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Innovation,       Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Swapped,          Frame, HOLD_THEN_FADE,                          true),
    rule(Flag::Merged,           Frame, &[(Warn, Auto), (HoldEstimate, Auto), (Fade, Auto)], true),
    rule(Flag::Lost,             Frame, WARN_THEN_FADE,                          true),
    rule(Flag::Unobservable,     Frame, WARN,                                    false),
    rule(Flag::FollowingError,   Rig,   &[(QuickStop, Engage)],                  false),
    rule(Flag::ReferenceJump,    Tick,  &[(HoldMotion, Engage)],                 false),
    rule(Flag::ReferenceFast,    Tick,  WARN,                                    false),
    rule(Flag::ReferenceLate,    Tick,  &[(HoldMotion, Engage)],                 false),
    rule(Flag::ReferenceInvalid, Tick,  &[(HoldMotion, Engage)],                 false),
    rule(Flag::LateTick,         Tick,  &[(Warn, Auto), (HoldMotion, Engage)],   false),
    rule(Flag::DriveFault,       Rig,   &[(QuickStop, Engage), (Disable, Restart)], true),
    rule(Flag::StartCheck,       Frame, &[(PassThrough, Engage)],                false),
    rule(Flag::WidthLimit,       Frame, WARN,                                    false),
    rule(Flag::Monitor,          Tick,  &[(Warn, Auto), (Disable, Restart)],     false),
    rule(Flag::CommandJump,      Tick,  &[(HoldMotion, Engage)],                 false),
    rule(Flag::Tremor,           Tick,  WARN,                                    false),
    rule(Flag::Overcompensation, Frame, WARN_THEN_FADE,                          true),
    rule(Flag::LimitCycle,       Frame, &[(Fade, Auto)],                         false),
    rule(Flag::SlackChanged,     Frame, WARN,                                    false),
    rule(Flag::GeometryOff,      Frame, WARN,                                    false),
    rule(Flag::FrameRate,        Frame, WARN,                                    false),
];
