//! `TautscopeLoop`, the loop of Fig. 6, and its control tick.
#![allow(unsafe_code)]

use std::ffi::c_char;
use std::ptr::null;

use tautscope_config::AnyLoop;
use tautscope_core::{Axes, BandLoop, DOFS};

use crate::document::{LoopDocument, Sensors};
use crate::pointers::{bytes, give, numbers, numbers_mut, take_back, write};
use crate::result::{Handle, TautscopeResult, failed, guarded, with_handle};
use crate::types::TautscopeHysteresis;

/// The loop: reference in, command out; images or other measurements update the estimate of the hysteresis.
pub struct TautscopeLoop {
    pub(crate) inner: AnyLoop,
    pub(crate) sensors: Sensors,
    period: f64,
    /// The last command, NaN before the first reference.
    command: [f64; DOFS],
    is_broken: bool,
}

impl Handle for TautscopeLoop {
    fn is_broken(&mut self) -> &mut bool {
        &mut self.is_broken
    }
}

impl TautscopeLoop {
    fn new(text: &[u8]) -> Result<Self, TautscopeResult> {
        let document = LoopDocument::new(text)?;
        Ok(Self {
            inner: document.inner,
            sensors: document.sensors,
            period: document.period,
            command: [f64::NAN; DOFS],
            is_broken: false,
        })
    }

    /// The loop of the article's instrument, for its bands.
    pub(crate) fn bands(&mut self) -> Result<&mut dyn BandLoop, TautscopeResult> {
        match &mut self.inner {
            AnyLoop::Bands(inner) => Ok(inner.as_mut()),
            AnyLoop::Axes(_) => Err(failed(
                TautscopeResult::Signal,
                format_args!(
                    "images: got a loop with [[dof]], which takes measurements of the tip"
                ),
            )),
        }
    }

    /// The loop with `[[dof]]`, and its sensors.
    pub(crate) fn axes(&mut self) -> Result<(&mut dyn Axes, &Sensors), TautscopeResult> {
        match &mut self.inner {
            AnyLoop::Axes(inner) => Ok((inner.as_mut(), &self.sensors)),
            AnyLoop::Bands(_) => Err(failed(
                TautscopeResult::Signal,
                format_args!("measurement: got a loop without [[dof]], which takes images"),
            )),
        }
    }

    pub(crate) fn check_dofs(&self, name: &str, found: usize) -> Result<(), TautscopeResult> {
        let dofs = self.inner.dofs();
        if found == dofs {
            return Ok(());
        }
        Err(failed(
            TautscopeResult::Size,
            format_args!("{name}: got {found}, expected {dofs}, the degrees of freedom"),
        ))
    }
}

/// Creates a loop at rest.
///
/// `toml` is the configuration, `length` its bytes; its key `profile` selects the profile. Keys that it does not have have their
/// defaults, but for `name` and `width_limit` of each `[[dof]]`. `*created` is the loop; destroy it with `tautscope_loop_destroy`.
///
/// # Safety
/// `toml` points to `length` readable bytes; `created` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_create(
    toml: *const u8,
    length: usize,
    created: *mut *mut TautscopeLoop,
) -> TautscopeResult {
    guarded(|| {
        // SAFETY: the caller's contract.
        let text = unsafe { bytes("toml", toml, length) }?;
        // SAFETY: the caller's contract.
        unsafe { give(created, TautscopeLoop::new(text)?) }
    })
}

/// Destroys a loop; null is ignored.
///
/// # Safety
/// The loop came from `tautscope_loop_create` and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_destroy(handle: *mut TautscopeLoop) {
    // SAFETY: the caller's contract.
    unsafe { take_back(handle) };
}

/// The number n of degrees of freedom, and the control period of the configuration (s). Either place may be null.
///
/// # Safety
/// The handle is valid and used by this thread only; `dofs` and `period` are null or writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_size(
    handle: *mut TautscopeLoop,
    dofs: *mut usize,
    period: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        let (dofs, period) = unsafe { (dofs.as_mut(), period.as_mut()) };
        if let Some(dofs) = dofs {
            *dofs = handle.inner.dofs();
        }
        if let Some(period) = period {
            *period = handle.period;
        }
        Ok(())
    })
}

/// Name and unit, "m" or "rad", of a degree of freedom from 0 to n - 1, else null; valid until the loop is destroyed.
///
/// # Safety
/// The handle is valid and used by this thread only; `name` and `unit` are writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_dof(
    handle: *mut TautscopeLoop,
    dof: usize,
    name: *mut *const c_char,
    unit: *mut *const c_char,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        let found = handle.sensors.names.get(dof);
        let texts = found.map_or([null(); 2], |[name, unit]| [name.as_ptr(), unit.as_ptr()]);
        // SAFETY: the caller's contract.
        unsafe {
            *write("name", name)? = texts[0];
            *write("unit", unit)? = texts[1];
        }
        Ok(())
    })
}

/// One control tick: the command for a reference. It does not allocate, block or read a clock.
///
/// `reference` and `command` are (n,) [m or rad], without `[[dof]]` insertion, rotation, bending [m, rad, rad]; `dofs` is n.
/// `time` is the caller's clock (s). `made_at` is when the reference was made on that clock (s), NaN if not known.
///
/// With any result but OK, and while motion is held, `command` is the last one, NaN before the first; with
/// `TAUTSCOPE_RESULT_SIZE` or `_NULL_POINTER`, or a handle that cannot be used any more, nothing is written.
///
/// # Safety
/// The handle is valid and used by this thread only; `reference` points to `dofs` numbers, `command` to place for as many.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_step(
    handle: *mut TautscopeLoop,
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
        if made_at.is_infinite() {
            return Err(not_finite("made_at", made_at));
        }
        let made_at = (!made_at.is_nan()).then_some(made_at);
        let next = &mut handle.command[..dofs];
        handle.inner.step(&taken[..dofs], made_at, time, next);
        command.copy_from_slice(next);
        Ok(())
    })
}

/// The state of the tip (n,) [m or rad] that the estimated slack predicts now; NaN before the first tick. `dofs` is n.
///
/// # Safety
/// The handle is valid and used by this thread only; `state` points to place for `dofs` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_predicted_state(
    handle: *mut TautscopeLoop,
    dofs: usize,
    state: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        handle.check_dofs("dofs", dofs)?;
        // SAFETY: the caller's contract.
        let state = unsafe { numbers_mut("state", state, dofs) }?;
        state.copy_from_slice(&handle.inner.predicted_state()[..dofs]);
        Ok(())
    })
}

/// The hysteresis estimated so far.
///
/// # Safety
/// The handle is valid and used by this thread only; `hysteresis` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_hysteresis(
    handle: *mut TautscopeLoop,
    hysteresis: *mut TautscopeHysteresis,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        *unsafe { write("hysteresis", hysteresis) }? = handle.inner.slack().into();
        Ok(())
    })
}

pub fn check_finite(name: &str, value: f64) -> Result<(), TautscopeResult> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(not_finite(name, value))
    }
}

fn not_finite(name: &str, value: f64) -> TautscopeResult {
    failed(
        TautscopeResult::Signal,
        format_args!("{name}: got {value}, expected a finite number"),
    )
}
