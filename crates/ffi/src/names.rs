//! Names of the header's numbers, and versions.

use std::ffi::{CStr, c_char};

use crate::types::TAUTSCOPE_ABI_VERSION;

/// Names of the flags, in their order.
const FLAG_NAMES: [&CStr; 27] = [
    c"frozen",
    c"late",
    c"duplicate",
    c"dropped",
    c"clock",
    c"innovation",
    c"swapped",
    c"merged",
    c"lost",
    c"unobservable",
    c"following_error",
    c"reference_jump",
    c"reference_fast",
    c"reference_late",
    c"reference_invalid",
    c"late_tick",
    c"drive_fault",
    c"start_check",
    c"width_limit",
    c"monitor",
    c"command_jump",
    c"tremor",
    c"overcompensation",
    c"limit_cycle",
    c"slack_changed",
    c"geometry_off",
    c"frame_rate",
];

const REACTION_NAMES: [&CStr; 8] = [
    c"none",
    c"warn",
    c"hold_estimate",
    c"fade",
    c"pass_through",
    c"hold_motion",
    c"quick_stop",
    c"disable",
];

const STATUS_NAMES: [&CStr; 7] = [
    c"ok",
    c"held",
    c"partial",
    c"no_markers",
    c"stale",
    c"duplicate",
    c"refused",
];

fn name(names: &[&'static CStr], index: u32) -> *const c_char {
    let found = usize::try_from(index)
        .ok()
        .and_then(|index| names.get(index));
    found.map_or(std::ptr::null(), |name| name.as_ptr())
}

/// Version of the interface of this library, `TAUTSCOPE_ABI_VERSION` of its header.
#[allow(unsafe_code, reason = "exported")]
#[unsafe(no_mangle)]
pub extern "C" fn tautscope_abi_version() -> u32 {
    TAUTSCOPE_ABI_VERSION
}

/// Version of this library, for example "0.1.0".
#[allow(unsafe_code, reason = "exported")]
#[unsafe(no_mangle)]
pub extern "C" fn tautscope_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Name of a `TautscopeFlag` in configuration, reports and logs; null for any other number.
#[allow(unsafe_code, reason = "exported")]
#[unsafe(no_mangle)]
pub extern "C" fn tautscope_flag_name(flag: u32) -> *const c_char {
    name(&FLAG_NAMES, flag)
}

/// Name of a `TautscopeReaction`; null for any other number.
#[allow(unsafe_code, reason = "exported")]
#[unsafe(no_mangle)]
pub extern "C" fn tautscope_reaction_name(reaction: u32) -> *const c_char {
    name(&REACTION_NAMES, reaction)
}

/// Name of a `TautscopeStatus`; null for any other number.
#[allow(unsafe_code, reason = "exported")]
#[unsafe(no_mangle)]
pub extern "C" fn tautscope_status_name(status: u32) -> *const c_char {
    name(&STATUS_NAMES, status)
}
