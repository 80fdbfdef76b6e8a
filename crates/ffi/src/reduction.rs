//! `TautscopeLoop`, the loop of Fig. 6, and its control tick.
#![allow(unsafe_code)]

use tautscope_core as core;

use crate::document::{Profile, config, loop_settings};
use crate::pointers::{bytes, give, read, take_back, write};
use crate::result::{Handle, TautscopeResult, failed, guarded, with_handle};

type Reduction<P> = Box<core::HysteresisReduction<P, Vec<core::Entry>>>;

/// The loop: reference in, command out; images update the estimate of the hysteresis.
pub struct TautscopeLoop {
    pub(crate) profile: Blocks,
    period: f64,
    /// The last command, NaN before the first reference.
    command: [f64; 3],
    is_broken: bool,
}

pub(crate) enum Blocks {
    Paper(Reduction<core::Paper>),
    Best(Reduction<core::Best>),
}

/// Evaluates an expression with the loop of either profile.
macro_rules! on_loop {
    ($handle:expr, $name:ident => $body:expr) => {
        match &mut $handle.profile {
            $crate::reduction::Blocks::Paper($name) => $body,
            $crate::reduction::Blocks::Best($name) => $body,
        }
    };
}
pub(crate) use on_loop;

impl Handle for TautscopeLoop {
    fn is_broken(&mut self) -> &mut bool {
        &mut self.is_broken
    }
}

impl TautscopeLoop {
    fn new(text: &[u8]) -> Result<Self, TautscopeResult> {
        let (settings, profile) = loop_settings(text)?;
        Ok(Self {
            profile: match profile {
                Profile::Paper => Blocks::Paper(build(&settings)?),
                Profile::Best => Blocks::Best(build(&settings)?),
            },
            period: settings.control.period,
            command: [f64::NAN; 3],
            is_broken: false,
        })
    }
}

fn build<P: core::BandProfile>(settings: &core::Settings) -> Result<Reduction<P>, TautscopeResult> {
    let storage = vec![core::Entry::BLANK; settings.history_entries()];
    core::HysteresisReduction::new(settings, storage)
        .map(Box::new)
        .map_err(|error| config(format_args!("{error}")))
}

/// Creates a loop at rest.
///
/// `toml` is the configuration with every key, as `tautscope config` prints it, `length` its bytes. Its key `profile` selects
/// the profile. `*created` is the loop; destroy it with `tautscope_loop_destroy`.
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
    // Dropping plain numbers does not panic; should it, the memory is lost and no more.
    let _ = guarded(|| {
        // SAFETY: the caller's contract.
        unsafe { take_back(handle) };
        Ok(())
    });
}

/// The control period of the configuration (s).
///
/// # Safety
/// The handle is valid and used by this thread only; `period` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_period(
    handle: *mut TautscopeLoop,
    period: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        *unsafe { write("period", period) }? = handle.period;
        Ok(())
    })
}

/// One control tick: the command for a reference, Eqs. (2)-(3). It does not allocate, block or read a clock.
///
/// `reference` and `command` are insertion, rotation, bending [m, rad, rad]. `time` is the caller's clock (s). `made_at` is when
/// the reference was made on that clock (s), NaN if not known.
///
/// With any result but OK, and while motion is held, `command` is the last one, NaN before the first.
///
/// # Safety
/// The handle is valid and used by this thread only; `reference` points to three numbers, `command` to place for three.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_step(
    handle: *mut TautscopeLoop,
    reference: *const f64,
    made_at: f64,
    time: f64,
    command: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        let command = unsafe { write("command", command.cast::<[f64; 3]>()) }?;
        *command = handle.command;
        // SAFETY: the caller's contract.
        let reference = unsafe { read("reference", reference.cast::<[f64; 3]>()) }?;
        for value in reference {
            check_finite("reference", *value)?;
        }
        check_finite("time", time)?;
        let made_at = check_made_at(made_at)?;
        handle.command = on_loop!(handle, inner => inner.step(*reference, made_at, time));
        *command = handle.command;
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

/// When a reference was made, if that is known.
pub fn check_made_at(made_at: f64) -> Result<Option<f64>, TautscopeResult> {
    if made_at.is_infinite() {
        return Err(not_finite("made_at", made_at));
    }
    Ok((!made_at.is_nan()).then_some(made_at))
}

fn not_finite(name: &str, value: f64) -> TautscopeResult {
    failed(
        TautscopeResult::Signal,
        format_args!("{name}: got {value}, expected a finite number"),
    )
}
