//! Names of flags and reactions.

use pyo3::prelude::*;
use tautscope_core as core;

use crate::errors;

/// The names of all flags.
// Inlined into the callers that join the names, this would take many minutes to compile.
#[inline(never)]
pub fn names() -> Vec<&'static str> {
    core::Flag::ALL.iter().map(|flag| flag.name()).collect()
}

/// The meaning of each flag.
pub fn meanings() -> Vec<&'static str> {
    core::Flag::ALL.iter().map(|flag| flag.meaning()).collect()
}

/// The names of the flags in a set.
pub fn set(flags: core::Flags) -> Vec<&'static str> {
    flags.iter().map(core::Flag::name).collect()
}

/// The flag of a name, or a `ConfigError` on `field`.
pub fn flag(py: Python<'_>, field: &str, name: &str) -> PyResult<core::Flag> {
    core::Flag::from_name(name)
        .ok_or_else(|| errors::choice(py, field, name, &format!("one of {}", names().join(", "))))
}

/// The name of a reaction.
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
