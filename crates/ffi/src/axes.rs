//! `TautscopeAxes`: the loop of 1 to 8 degrees of freedom whose tip any sensor measures.
#![allow(unsafe_code)]

use tautscope_axes::BoxedAxes;
use tautscope_core::DOFS;

use crate::document::{AxesDocument, axes_document, config};
use crate::pointers::{bytes, give, numbers, numbers_mut, take_back, write};
use crate::reduction::{check_finite, check_made_at};
use crate::result::{Handle, TautscopeResult, failed, guarded, with_handle};
use crate::supervision::{known_flag, share_error};
use crate::types::{TautscopeAxesHysteresis, TautscopeSupervision};

/// The loop of a robot with `[[dof]]`: reference in, command out; measurements of the tip update the estimate of the hysteresis.
pub struct TautscopeAxes {
    pub(crate) axes: BoxedAxes,
    pub(crate) document: AxesDocument,
    /// The last command, NaN before the first reference.
    command: [f64; DOFS],
    is_broken: bool,
}

impl Handle for TautscopeAxes {
    fn is_broken(&mut self) -> &mut bool {
        &mut self.is_broken
    }
}

impl TautscopeAxes {
    fn new(text: &[u8]) -> Result<Self, TautscopeResult> {
        let document = axes_document(text)?;
        let axes = document.axes.build(true);
        Ok(Self {
            axes: axes.map_err(|error| config(format_args!("{error}")))?,
            document,
            command: [f64::NAN; DOFS],
            is_broken: false,
        })
    }

    pub(crate) fn check_dofs(&self, name: &str, found: usize) -> Result<(), TautscopeResult> {
        let dofs = self.axes.dofs();
        if found == dofs {
            return Ok(());
        }
        Err(failed(
            TautscopeResult::Size,
            format_args!("{name}: got {found}, expected {dofs}, the degrees of freedom"),
        ))
    }

    pub(crate) fn width(&self, dof: usize) -> f64 {
        self.document.axes.dof[dof].width_limit
    }
}

/// Creates a loop at rest.
///
/// `toml` is a configuration with `[[dof]]`, of which each needs a `name` and a `width_limit`; `length` is its bytes. Keys that it
/// does not have have their defaults, so that it may also be what `tautscope config` prints. `*created` is the loop; destroy it
/// with `tautscope_axes_destroy`.
///
/// # Safety
/// `toml` points to `length` readable bytes; `created` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_create(
    toml: *const u8,
    length: usize,
    created: *mut *mut TautscopeAxes,
) -> TautscopeResult {
    guarded(|| {
        // SAFETY: the caller's contract.
        let text = unsafe { bytes("toml", toml, length) }?;
        // SAFETY: the caller's contract.
        unsafe { give(created, TautscopeAxes::new(text)?) }
    })
}

/// Destroys a loop; null is ignored.
///
/// # Safety
/// The loop came from `tautscope_axes_create` and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_destroy(handle: *mut TautscopeAxes) {
    // Dropping plain numbers does not panic; should it, the memory is lost and no more.
    let _ = guarded(|| {
        // SAFETY: the caller's contract.
        unsafe { take_back(handle) };
        Ok(())
    });
}

/// The number n of degrees of freedom, and the control period of the configuration (s). Either place may be null.
///
/// # Safety
/// The handle is valid and used by this thread only; `dofs` and `period` are null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_size(
    handle: *mut TautscopeAxes,
    dofs: *mut usize,
    period: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        let (dofs, period) = unsafe { (dofs.as_mut(), period.as_mut()) };
        if let Some(dofs) = dofs {
            *dofs = handle.axes.dofs();
        }
        if let Some(period) = period {
            *period = handle.document.axes.control.period;
        }
        Ok(())
    })
}

/// One control tick: the command for a reference. It does not allocate, block or read a clock.
///
/// `reference` and `command` are (n,) [m or rad]; `dofs` is n. `time` is the caller's clock (s). `made_at` is when the reference was
/// made on that clock (s), NaN if not known.
///
/// With any result but OK, and while motion is held, `command` is the last one, NaN before the first; with
/// `TAUTSCOPE_RESULT_SIZE` nothing is written.
///
/// # Safety
/// The handle is valid and used by this thread only; `reference` points to `dofs` numbers, `command` to place for as many.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_step(
    handle: *mut TautscopeAxes,
    dofs: usize,
    reference: *const f64,
    made_at: f64,
    time: f64,
    command: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.check_dofs("dofs", dofs)?;
        // The caller may use one array for both.
        // SAFETY: the caller's contract.
        let given = unsafe { numbers("reference", reference, dofs) };
        let mut taken = [f64::NAN; DOFS];
        let given = given.map(|values| taken[..dofs].copy_from_slice(values));
        // SAFETY: the caller's contract.
        let command = unsafe { numbers_mut("command", command, dofs) }?;
        command.copy_from_slice(&handle.command[..dofs]);
        given?;
        for value in &taken[..dofs] {
            check_finite("reference", *value)?;
        }
        check_finite("time", time)?;
        let made_at = check_made_at(made_at)?;
        let next = &mut handle.command[..dofs];
        handle.axes.step(&taken[..dofs], made_at, time, next);
        command.copy_from_slice(next);
        Ok(())
    })
}

/// The state of the tip (n,) [m or rad] that the estimated slack predicts now; NaN before the first tick. `dofs` is n.
///
/// # Safety
/// The handle is valid and used by this thread only; `state` points to place for `dofs` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_predicted_state(
    handle: *mut TautscopeAxes,
    dofs: usize,
    state: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.check_dofs("dofs", dofs)?;
        // SAFETY: the caller's contract.
        let state = unsafe { numbers_mut("state", state, dofs) }?;
        state.copy_from_slice(&handle.axes.predicted_state()[..dofs]);
        Ok(())
    })
}

/// The hysteresis estimated so far.
///
/// # Safety
/// The handle is valid and used by this thread only; `hysteresis` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_hysteresis(
    handle: *mut TautscopeAxes,
    hysteresis: *mut TautscopeAxesHysteresis,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        *unsafe { write("hysteresis", hysteresis) }? = handle.axes.hysteresis().into();
        Ok(())
    })
}

/// State of the supervision now.
///
/// # Safety
/// The handle is valid and used by this thread only; `supervision` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_supervision(
    handle: *mut TautscopeAxes,
    supervision: *mut TautscopeSupervision,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        *unsafe { write("supervision", supervision) }? = handle.axes.supervision().into();
        Ok(())
    })
}

/// Re-engages: resumes held motion, without a jump of the command.
///
/// # Safety
/// The handle is valid and used by this thread only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_engage(handle: *mut TautscopeAxes) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.axes.engage();
        Ok(())
    })
}

/// Acknowledges the warnings: empties `latched`; nothing else changes.
///
/// # Safety
/// The handle is valid and used by this thread only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_acknowledge(handle: *mut TautscopeAxes) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.axes.acknowledge();
        Ok(())
    })
}

/// Uses a share of the compensation: all with 1, none with 0. The command moves only with the reference.
///
/// # Safety
/// The handle is valid and used by this thread only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_set_compensation(
    handle: *mut TautscopeAxes,
    share: f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.axes.set_compensation(share).map_err(share_error)
    })
}

/// Raises a `TautscopeFlag` that only the rig can detect, as `tautscope_loop_raise_flag`.
///
/// # Safety
/// The handle is valid and used by this thread only.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_axes_raise_flag(
    handle: *mut TautscopeAxes,
    flag: u32,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.axes.raise(known_flag(flag)?);
        Ok(())
    })
}
