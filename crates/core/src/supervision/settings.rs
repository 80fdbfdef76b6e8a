//! Settings of all monitors and of the supervisor.

use crate::supervision::flags::Flags;

/// Section `safety` of the configuration: the same names, units and meaning as in `python/tautscope/config/safety.py`,
/// which has the defaults.
///
/// Lengths of a degree of freedom are in m or rad. A constructor checks the settings that it reads, and converts
/// those that are in multiples of another length.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize),
    serde(bound(
        deserialize = "[f64; N]: serde::Deserialize<'de>, [(f64, f64); N]: serde::Deserialize<'de>"
    ))
)]
pub struct SafetySettings<const N: usize = 3> {
    /// Detectors that are switched off.
    pub off: Flags,
    /// Largest estimated width of the slack [m or rad]; also the largest |c - u|, and the unit of the travels below.
    pub width_limit: [f64; N],
    /// Largest absolute value of an estimated contact offset [m or rad].
    pub offset_limit: [f64; N],
    /// Largest speed of the reference over `reference_time` at which it is followed [m/s or rad/s].
    pub reference_speed: [f64; N],
    /// Time constant of the mean of the reference's speed, in s.
    pub reference_time: f64,
    /// Largest speed of the command [m/s or rad/s].
    pub command_speed: [f64; N],
    /// Least and largest command [m or rad].
    pub command_travel: [(f64, f64); N],
    /// Resolution of the input device, or its largest step from rest [m or rad].
    pub reference_count: [f64; N],
    /// Largest age of a reference, and longest time for which a moving input device repeats its value, in s.
    pub reference_age: f64,
    /// Longest time between two control ticks whose motion is followed, in control periods.
    pub late_tick: f64,
    /// Longest time between two control ticks after which motion goes on by itself, in s.
    pub stall: f64,
    /// Largest age of a frame on arrival, in s.
    pub frame_age: f64,
    /// Longest time without a frame, in s.
    pub frame_gap: f64,
    /// Difference of two capture times by which the clock was set back; a smaller one is a frame out of order, in s.
    pub clock_jump: f64,
    /// Travel of the command over which no two images are identical [in `update_distance`].
    pub frozen_travel: f64,
    /// Largest innovation, in standard deviations.
    pub innovation_limit: f64,
    /// Least swing of a tremor [in `update_distance`].
    pub tremor_swing: f64,
    /// Reversals per second that are a tremor, in 1/s.
    pub tremor_rate: f64,
    /// Largest lead of the tip over the reference within a stroke [in `width_limit`].
    pub ahead_limit: f64,
    /// Travel of the tip over that of the reference in a stroke above which the tip overtakes.
    pub ahead_ratio: f64,
    /// Largest decrease of a contact offset within a stroke [in `ahead_limit`].
    pub offset_decrease: f64,
    /// Growing swings in a row that are a limit cycle.
    pub cycle_swings: u32,
    /// Least ratio of a swing to the one before it in a limit cycle.
    pub cycle_growth: f64,
    /// Longest swing of a limit cycle, one way, in s.
    pub cycle_time: f64,
    /// Time until a reaction escalates, in s.
    pub hold_time: f64,
    /// Travel of the reference until a reaction escalates, summed over the DOFs [in `width_limit`].
    pub hold_travel: f64,
    /// Travel over which the compensation fades to nothing [in `width_limit`].
    pub fade_travel: f64,
    /// Travel over which the compensation returns after the cause of a fade has cleared [in `width_limit`].
    pub restore_travel: f64,
    /// Good frames in a row that clear a flag of frames.
    pub good_frames: u32,
    /// Good control ticks in a row that clear a flag of ticks.
    pub good_ticks: u32,
}
