//! `Monitors`: what `Reduction` is watched by.

use pyo3::prelude::*;
use tautscope_core as core;

use crate::errors;

/// Monitors of a loop, to be given to `Reduction`. Raises `ConfigError`.
#[pyclass(name = "Monitors", module = "tautscope._core", frozen)]
pub struct Monitors(pub core::Monitors);

#[pymethods]
impl Monitors {
    #[new]
    #[pyo3(signature = (
        *, period, gain_limit, reference_speed, reference_time, reference_count, reference_age,
        late_tick, stall,
        command_speed, command_travel, width_limit, offset_limit,
        frame_age, frame_gap, frozen_travel, innovation_limit, start_deviation,
        innovation_floor, jump, grip_distance, slip, blind_growth,
        motion,
        hold_time, hold_travel, fade_travel, restore_travel, good_frames, good_ticks, off
    ))]
    // One argument per setting, by keyword only.
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        period: f64,
        gain_limit: [f64; 3],
        reference_speed: [f64; 3],
        reference_time: f64,
        reference_count: [f64; 3],
        reference_age: f64,
        late_tick: f64,
        stall: f64,
        command_speed: [f64; 3],
        command_travel: [(f64, f64); 3],
        width_limit: [f64; 3],
        offset_limit: [f64; 3],
        frame_age: f64,
        frame_gap: f64,
        frozen_travel: [f64; 3],
        innovation_limit: f64,
        start_deviation: [f64; 3],
        innovation_floor: [f64; 3],
        jump: [f64; 3],
        grip_distance: [f64; 3],
        slip: [f64; 3],
        blind_growth: f64,
        motion: &MotionMonitor,
        hold_time: f64,
        hold_travel: f64,
        fade_travel: f64,
        restore_travel: f64,
        good_frames: u32,
        good_ticks: u32,
        off: Vec<String>,
    ) -> PyResult<Self> {
        let monitor = |dof: usize| core::CommandLimits {
            gain_limit: gain_limit[dof],
            step_limit: command_speed[dof] * period,
            travel: command_travel[dof],
            lead_limit: width_limit[dof],
        };
        let settings = core::MonitorsSettings {
            clutch: core::ReferenceGateSettings {
                period,
                reference_speed,
                reference_time,
                reference_count,
                reference_age,
                late_tick,
                stall,
            },
            limits: [0, 1, 2].map(monitor),
            frames: core::FrameGateSettings {
                frame_age,
                frame_gap,
                frozen_travel,
                innovation_limit,
                start_deviation,
                least_deviation: innovation_floor,
                jump,
                grips: [0, 1, 2].map(|dof: usize| core::GripSettings {
                    distance: grip_distance[dof],
                    slip: slip[dof],
                }),
                blind_growth,
            },
            motion: motion.0,
            changes: motion.1,
            supervisor: core::SupervisorSettings {
                hold_time,
                hold_travel,
                fade_travel,
                restore_travel,
                good_frames,
                good_ticks,
            },
            width_limit,
            offset_limit,
            off: off
                .iter()
                .map(|name| flag(py, "off", name).map(core::Flags::of))
                .try_fold(core::Flags::NONE, |all, one| one.map(|one| all.and(one)))?,
        };
        core::Monitors::new(settings)
            .map(Self)
            .map_err(errors::config(py))
    }
}

/// What of hand, tip and lessons is watched, to be given to `Monitors`, which checks it.
#[pyclass(name = "MotionMonitor", module = "tautscope._core", frozen)]
pub struct MotionMonitor(core::MotionMonitorSettings, core::ChangeSettings);

#[pymethods]
impl MotionMonitor {
    #[new]
    #[pyo3(signature = (
        *, period, tremor_swing, slack, tremor_rate, turn, ahead_limit, cycle_swings, cycle_time,
        change_limit, change_travel
    ))]
    // One argument per setting, by keyword only.
    #[allow(clippy::too_many_arguments)]
    fn new(
        period: f64,
        tremor_swing: [f64; 3],
        slack: [f64; 3],
        tremor_rate: f64,
        turn: [f64; 3],
        ahead_limit: [f64; 3],
        cycle_swings: u32,
        cycle_time: f64,
        change_limit: [f64; 3],
        change_travel: [f64; 3],
    ) -> Self {
        let motion = core::MotionMonitorSettings {
            period,
            tremor_swing,
            slack,
            tremor_rate,
            turn,
            ahead: ahead_limit,
            cycle_swings,
            cycle_time,
        };
        let changes = core::ChangeSettings {
            limit: change_limit,
            travel: change_travel,
        };
        Self(motion, changes)
    }
}

/// The names of all flags.
// Inlined into what joins them, they would take many minutes to compile.
#[inline(never)]
pub fn names() -> Vec<&'static str> {
    core::Flag::ALL.iter().map(|flag| flag.name()).collect()
}

/// What each of them says.
pub fn meanings() -> Vec<&'static str> {
    core::Flag::ALL.iter().map(|flag| flag.meaning()).collect()
}

/// The names of those in a set.
pub fn set(flags: core::Flags) -> Vec<&'static str> {
    flags.iter().map(core::Flag::name).collect()
}

/// The flag of a name, or a `ConfigError` on `field`.
pub fn flag(py: Python<'_>, field: &str, name: &str) -> PyResult<core::Flag> {
    core::Flag::named(name)
        .ok_or_else(|| errors::choice(py, field, name, &format!("one of {}", names().join(", "))))
}

/// A reaction as Python calls it.
pub fn reaction_name(reaction: core::Reaction) -> &'static str {
    match reaction {
        core::Reaction::None => "none",
        core::Reaction::Warn => "warn",
        core::Reaction::HoldEstimate => "hold_estimate",
        core::Reaction::Fade => "fade",
        core::Reaction::PassThrough => "pass_through",
        core::Reaction::HoldMotion => "hold_motion",
        core::Reaction::QuickStop => "quick_stop",
        core::Reaction::Disable => "disable",
    }
}
