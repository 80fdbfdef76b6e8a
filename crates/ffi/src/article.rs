//! `TautscopeCompensator` and `TautscopeEstimator`: the article's scheme for 1 to 8 degrees of freedom, each by itself.
#![allow(unsafe_code)]

use tautscope_core as core;
use tautscope_core::DOFS;

use crate::document::config;
use crate::pointers::{give, numbers, take_back};
use crate::result::{Handle, TautscopeResult, failed, guarded, null, with_handle};

/// Settings of the compensator of a degree of freedom, in its unit.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautscopeCompensatorSettings {
    /// Gain while the slack is crossed, `K_b` of the article: from 1, which compensates nothing, to `gain_limit`.
    pub free_gain: f64,
    /// Upper bound of every gain.
    pub gain_limit: f64,
    /// Share of the reference's travel by which the command returns to the reference after changed offsets; 0: it does not.
    pub recovery: f64,
    /// Negative contact offset, input minus output.
    pub delta_minus: f64,
    /// Positive contact offset, input minus output.
    pub delta_plus: f64,
}

/// Settings of the estimator of a degree of freedom, in its unit.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TautscopeEstimatorSettings {
    /// Travel of the command between two updates, tau.
    pub update_distance: f64,
    /// Contact tolerance, epsilon, between 0 and 1.
    pub contact_tolerance: f64,
    /// Smoothing factor, alpha, per `update_distance` travelled, between 0 and 1.
    pub smoothing_factor: f64,
    /// First negative contact offset, input minus output.
    pub delta_minus: f64,
    /// First positive contact offset, input minus output.
    pub delta_plus: f64,
}

/// Inverse of the play of 1 to 8 degrees of freedom, Eqs. (2)-(3).
pub struct TautscopeCompensator {
    axes: Vec<(core::Compensator, core::CompensatorState)>,
    is_broken: bool,
}

/// Estimation of the contact offsets of 1 to 8 degrees of freedom, Eqs. (4)-(6).
pub struct TautscopeEstimator {
    axes: Vec<(core::Estimator, core::EstimatorState)>,
    is_broken: bool,
}

impl Handle for TautscopeCompensator {
    fn is_broken(&mut self) -> &mut bool {
        &mut self.is_broken
    }
}

impl Handle for TautscopeEstimator {
    fn is_broken(&mut self) -> &mut bool {
        &mut self.is_broken
    }
}

impl TautscopeCompensatorSettings {
    fn build(&self) -> Result<(core::Compensator, core::CompensatorState), core::ConfigError> {
        let inner = core::Compensator::new(self.free_gain, self.gain_limit)?;
        let play = core::Play::new(self.delta_minus, self.delta_plus)?;
        let inner = inner.with_recovery(self.recovery)?;
        Ok((inner, core::CompensatorState::new(play)))
    }
}

impl TautscopeEstimatorSettings {
    fn build(&self) -> Result<(core::Estimator, core::EstimatorState), core::ConfigError> {
        let (distance, tolerance) = (self.update_distance, self.contact_tolerance);
        let inner = core::Estimator::new(distance, tolerance, self.smoothing_factor)?;
        let play = core::Play::new(self.delta_minus, self.delta_plus)?;
        Ok((inner, core::EstimatorState::new(play)))
    }
}

/// What each setting makes; 1 to 8 of them.
///
/// # Safety
/// `settings` is null or points to `dofs` readable structures.
unsafe fn each<S: Copy, T>(
    settings: *const S,
    dofs: usize,
    build: impl Fn(&S) -> Result<T, core::ConfigError>,
) -> Result<Vec<T>, TautscopeResult> {
    if !(1..=DOFS).contains(&dofs) {
        return Err(size(dofs, "1 to 8"));
    }
    if settings.is_null() {
        return Err(null("settings"));
    }
    // SAFETY: the caller's contract.
    let all = unsafe { std::slice::from_raw_parts(settings, dofs) };
    let made = all.iter().enumerate().map(|(dof, own)| {
        build(own).map_err(|error| config(format_args!("degree of freedom {dof}: {error}")))
    });
    made.collect()
}

fn size(found: usize, expected: impl std::fmt::Display) -> TautscopeResult {
    failed(
        TautscopeResult::Size,
        format_args!("dofs: got {found}, expected {expected}"),
    )
}

fn check_dofs<T>(axes: &[T], found: usize) -> Result<(), TautscopeResult> {
    if found == axes.len() {
        return Ok(());
    }
    Err(size(found, axes.len()))
}

/// Creates a compensator at rest from the settings of each of its 1 to 8 degrees of freedom.
///
/// # Safety
/// `settings` points to `dofs` structures; `created` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_compensator_create(
    settings: *const TautscopeCompensatorSettings,
    dofs: usize,
    created: *mut *mut TautscopeCompensator,
) -> TautscopeResult {
    guarded(|| {
        // SAFETY: the caller's contract.
        let axes = unsafe { each(settings, dofs, TautscopeCompensatorSettings::build) }?;
        let is_broken = false;
        // SAFETY: the caller's contract.
        unsafe { give(created, TautscopeCompensator { axes, is_broken }) }
    })
}

/// Destroys a compensator; null is ignored.
///
/// # Safety
/// It came from `tautscope_compensator_create` and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_compensator_destroy(handle: *mut TautscopeCompensator) {
    // SAFETY: the caller's contract.
    unsafe { take_back(handle) };
}

/// The command (n,) for the next reference (n,). The first one is the reference; a reference that has not changed, or is not
/// finite, repeats the last command of its degree of freedom.
///
/// # Safety
/// The handle is valid and used by this thread only; `reference` points to `dofs` numbers, `command` to place for as many.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_compensator_step(
    handle: *mut TautscopeCompensator,
    dofs: usize,
    reference: *const f64,
    command: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        check_dofs(&handle.axes, dofs)?;
        if reference.is_null() || command.is_null() {
            return Err(null("reference or command"));
        }
        for (dof, (inner, state)) in handle.axes.iter_mut().enumerate() {
            // One array may be both.
            // SAFETY: the caller's contract.
            unsafe { *command.add(dof) = inner.step(state, *reference.add(dof)) };
        }
        Ok(())
    })
}

/// Changes the contact offsets (n,), input minus output; the command does not move.
///
/// # Safety
/// The handle is valid and used by this thread only; `delta_minus` and `delta_plus` point to `dofs` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_compensator_set_offsets(
    handle: *mut TautscopeCompensator,
    dofs: usize,
    delta_minus: *const f64,
    delta_plus: *const f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        check_dofs(&handle.axes, dofs)?;
        // SAFETY: the caller's contract.
        let (minus, plus) = unsafe {
            let minus = numbers("delta_minus", delta_minus, dofs)?;
            (minus, numbers("delta_plus", delta_plus, dofs)?)
        };
        let play = |(minus, plus): (&f64, &f64)| core::Play::new(*minus, *plus);
        let wrong = |error| failed(TautscopeResult::Signal, format_args!("{error}"));
        for play in minus.iter().zip(plus).map(play) {
            play.map_err(wrong)?;
        }
        for ((inner, state), play) in handle.axes.iter_mut().zip(minus.iter().zip(plus).map(play)) {
            inner.retune(state, play.map_err(wrong)?);
        }
        Ok(())
    })
}

/// Creates an estimator from the settings of each of its 1 to 8 degrees of freedom.
///
/// # Safety
/// `settings` points to `dofs` structures; `created` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_estimator_create(
    settings: *const TautscopeEstimatorSettings,
    dofs: usize,
    created: *mut *mut TautscopeEstimator,
) -> TautscopeResult {
    guarded(|| {
        // SAFETY: the caller's contract.
        let axes = unsafe { each(settings, dofs, TautscopeEstimatorSettings::build) }?;
        let is_broken = false;
        // SAFETY: the caller's contract.
        unsafe { give(created, TautscopeEstimator { axes, is_broken }) }
    })
}

/// Destroys an estimator; null is ignored.
///
/// # Safety
/// It came from `tautscope_estimator_create` and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_estimator_destroy(handle: *mut TautscopeEstimator) {
    // SAFETY: the caller's contract.
    unsafe { take_back(handle) };
}

/// Updates the offsets from a command (n,) and the output (n,) measured at the same instant, NaN where it was not measured.
/// `delta_minus` and `delta_plus` are then the estimated offsets (n,), input minus output.
///
/// # Safety
/// The handle is valid and used by this thread only; `command` and `measured` point to `dofs` numbers, `delta_minus` and
/// `delta_plus` to place for as many.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_estimator_update(
    handle: *mut TautscopeEstimator,
    dofs: usize,
    command: *const f64,
    measured: *const f64,
    delta_minus: *mut f64,
    delta_plus: *mut f64,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        check_dofs(&handle.axes, dofs)?;
        // SAFETY: the caller's contract.
        let (command, measured) = unsafe {
            let command = numbers("command", command, dofs)?;
            (command, numbers("measured", measured, dofs)?)
        };
        let signals = command.iter().zip(measured);
        if delta_minus.is_null() || delta_plus.is_null() {
            return Err(null("delta_minus or delta_plus"));
        }
        for ((inner, state), (command, measured)) in handle.axes.iter_mut().zip(signals) {
            inner.update(state, *command, *measured);
        }
        for (dof, (_, state)) in handle.axes.iter().enumerate() {
            // SAFETY: the caller's contract.
            unsafe {
                *delta_minus.add(dof) = state.play().delta_minus();
                *delta_plus.add(dof) = state.play().delta_plus();
            }
        }
        Ok(())
    })
}
