//! Supervision of `TautscopeLoop`: its state, and what engages, warns and stops.
#![allow(unsafe_code)]

use tautscope_core as core;

use crate::pointers::write;
use crate::reduction::TautscopeLoop;
use crate::result::{TautscopeResult, failed, with_handle};
use crate::types::TautscopeSupervision;

/// State of the supervision now.
///
/// # Safety
/// The handle is valid and used by this thread only; `supervision` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_supervision(
    handle: *mut TautscopeLoop,
    supervision: *mut TautscopeSupervision,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        *unsafe { write("supervision", supervision) }? = handle.inner.supervision().into();
        Ok(())
    })
}

/// Re-engages: resumes held motion, without a jump of the command.
///
/// # Safety
/// The handle is valid and used by this thread only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_engage(handle: *mut TautscopeLoop) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.inner.engage();
        Ok(())
    })
}

/// Acknowledges the warnings: empties `latched`; nothing else changes.
///
/// # Safety
/// The handle is valid and used by this thread only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_acknowledge(handle: *mut TautscopeLoop) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.inner.acknowledge();
        Ok(())
    })
}

/// Uses a share of the compensation: all with 1, none with 0. The command moves only with the reference.
///
/// # Safety
/// The handle is valid and used by this thread only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_set_compensation(
    handle: *mut TautscopeLoop,
    share: f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        let done = handle.inner.set_compensation(share);
        done.map_err(|error| failed(TautscopeResult::Signal, format_args!("{error}")))
    })
}

/// Raises a `TautscopeFlag` that only the rig can detect. `DRIVE_FAULT` stops the motion; the reaction is then `QUICK_STOP`,
/// until `tautscope_loop_engage`; raised again after `safety.hold_time` or `hold_travel` it is `DISABLE`, for good.
///
/// # Safety
/// The handle is valid and used by this thread only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_raise_flag(
    handle: *mut TautscopeLoop,
    flag: u32,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        let known = core::Flag::ALL.get(flag as usize).copied();
        let wrong = || {
            failed(
                TautscopeResult::Signal,
                format_args!("flag: got {flag}, expected a TautscopeFlag"),
            )
        };
        handle.inner.raise(known.ok_or_else(wrong)?);
        Ok(())
    })
}
