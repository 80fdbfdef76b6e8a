//! `Monitors`: what `Reduction` is watched by.

use pyo3::prelude::*;
use tautscope_core as core;

use crate::errors;

/// A table of settings from the attributes of an object of the configuration.
macro_rules! settings {
    ($table:ident from $object:expr, $($given:ident)?; $($field:ident)+) => {
        core::$table {
            $($given,)?
            $($field: $object.getattr(stringify!($field))?.extract()?,)+
        }
    };
}

/// Monitors of a loop, to be given to `Reduction`: from `SafetyConfig`, three `DofConfig` and the control period in s.
/// Raises `ConfigError`.
#[pyclass(name = "Monitors", module = "tautscope._core", frozen)]
pub struct Monitors(pub core::Monitors);

#[pymethods]
impl Monitors {
    #[new]
    fn new(
        py: Python<'_>,
        safety: &Bound<'_, PyAny>,
        dofs: [Bound<'_, PyAny>; 3],
        period: f64,
    ) -> PyResult<Self> {
        let mut off = core::Flags::NONE;
        for name in safety.getattr("off")?.extract::<Vec<String>>()? {
            off = off.union(core::Flags::of(flag(py, "off", &name)?));
        }
        let safety = settings!(SafetySettings from safety, off; width_limit offset_limit reference_speed reference_time command_speed command_travel reference_count reference_age late_tick stall frame_age frame_gap clock_jump frozen_travel innovation_limit innovation_floor innovation_growth innovation_decay jump slip grip_distance blind_growth tremor_swing tremor_rate ahead_limit ahead_ratio offset_decrease cycle_swings cycle_growth cycle_time change_limit change_travel hold_time hold_travel fade_travel restore_travel good_frames good_ticks);
        let [insertion, rotation, bending] = &dofs;
        let dofs = [
            dof_settings(insertion)?,
            dof_settings(rotation)?,
            dof_settings(bending)?,
        ];
        core::Monitors::new(&safety, &dofs, period)
            .map(Self)
            .map_err(errors::config(py))
    }
}

fn dof_settings(dof: &Bound<'_, PyAny>) -> PyResult<core::DofSettings> {
    Ok(
        settings!(DofSettings from dof,; update_distance observable_deviation start_deviation free_gain gain_limit recovery contact_tolerance smoothing_factor delta_minus delta_plus),
    )
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
    core::Flag::from_name(name)
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
