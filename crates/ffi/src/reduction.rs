//! `TautscopeLoop`: the loop of Fig. 6.
#![allow(unsafe_code)]

use std::mem::offset_of;

use tautscope_core as core;

use crate::detector::{TautscopeDetector, detect};
use crate::document::{Profile, config, loop_settings};
use crate::pointers::{bytes, give, read, take_back, write};
use crate::result::{Handle, TautscopeResult, failed, guarded, with_handle};
use crate::types::{
    TautscopeDetection, TautscopeImage, TautscopeRejection, TautscopeReport,
    TautscopeStatePrediction, TautscopeSupervision,
};

type Reduction<P> = Box<core::HysteresisReduction<P, Vec<core::Entry>>>;

/// The loop: reference in, command out; images update the estimate of the hysteresis.
pub struct TautscopeLoop {
    profile: Blocks,
    period: f64,
    /// The last command, NaN before the first reference.
    command: [f64; 3],
    is_broken: bool,
}

enum Blocks {
    Paper(Reduction<core::Paper>),
    Best(Reduction<core::Best>),
}

/// Evaluates an expression with the loop of either profile.
macro_rules! on_loop {
    ($handle:expr, $name:ident => $body:expr) => {
        match &mut $handle.profile {
            Blocks::Paper($name) => $body,
            Blocks::Best($name) => $body,
        }
    };
}

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

    fn update(
        &mut self,
        features: Option<[f64; 4]>,
        covariance: Option<&[[f64; 4]; 4]>,
        captured_at: f64,
        checksum: Option<u64>,
    ) -> TautscopeReport {
        let report =
            on_loop!(self, inner => inner.on_features(features, covariance, captured_at, checksum));
        TautscopeReport::new(&report, captured_at)
    }

    fn on_detection(
        &mut self,
        detection: &TautscopeDetection,
        captured_at: f64,
    ) -> Result<TautscopeReport, TautscopeResult> {
        let is_found = detection
            .rejections
            .map(|reason| reason == TautscopeRejection::None as u32);
        check_bands(&detection.features, is_found)?;
        let found = is_found.contains(&true);
        Ok(self.update(
            found.then_some(detection.features),
            found.then_some(&detection.covariance),
            captured_at,
            Some(detection.checksum.into()),
        ))
    }

    fn predict(&mut self, captured_at: f64) -> TautscopeStatePrediction {
        let known = on_loop!(self, inner => inner.predict_state(captured_at));
        TautscopeStatePrediction {
            state: known.map_or([f64::NAN; 3], |known| known.state),
            std: known.map_or([f64::NAN; 3], |known| known.deviation),
            is_known: known.is_some().into(),
        }
    }
}

fn build<P: core::Profile>(settings: &core::Settings) -> Result<Reduction<P>, TautscopeResult> {
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
        if made_at.is_infinite() {
            return Err(not_finite("made_at", made_at));
        }
        let made_at = (!made_at.is_nan()).then_some(made_at);
        handle.command = on_loop!(handle, inner => inner.step(*reference, made_at, time));
        *command = handle.command;
        Ok(())
    })
}

/// Image update with the centroids of the bands from the caller's own detector. It does not allocate.
///
/// `features` are u, v of band A, u, v of band B (px): two NaN for a band that was not found, null if neither was.
/// `captured_at` is the time of capture on the clock of `tautscope_loop_step` (s). `report` may be null.
///
/// # Safety
/// The handle is valid and used by this thread only; `features` is null or points to four numbers; `report` is null or points to
/// as many writable bytes as its member `size` states.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_on_features(
    handle: *mut TautscopeLoop,
    features: *const f64,
    captured_at: f64,
    report: *mut TautscopeReport,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        unsafe { check_report(report) }?;
        check_finite("captured_at", captured_at)?;
        // SAFETY: the caller's contract.
        let features = unsafe { features.cast::<[f64; 4]>().as_ref() };
        if let Some([ua, va, ub, vb]) = features {
            let is_found = [[ua, va], [ub, vb]].map(|[u, v]| !(u.is_nan() && v.is_nan()));
            if is_found == [false; 2] {
                return Err(failed(
                    TautscopeResult::Signal,
                    format_args!("features: got NaN for both bands, expected null"),
                ));
            }
            check_bands(&[*ua, *va, *ub, *vb], is_found)?;
        }
        let done = handle.update(features.copied(), None, captured_at, None);
        // SAFETY: checked above.
        unsafe { write_report(report, &done) };
        Ok(())
    })
}

/// State at a capture time with its standard deviation: what `tautscope_detector_detect` needs. It does not allocate.
///
/// # Safety
/// The handle is valid and used by this thread only; `prediction` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_predict_state(
    handle: *mut TautscopeLoop,
    captured_at: f64,
    prediction: *mut TautscopeStatePrediction,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        check_finite("captured_at", captured_at)?;
        // SAFETY: the caller's contract.
        *unsafe { write("prediction", prediction) }? = handle.predict(captured_at);
        Ok(())
    })
}

/// Image update with the result of `tautscope_detector_detect`. It does not allocate.
///
/// # Safety
/// As `tautscope_loop_on_features`; `detection` points to what `tautscope_detector_detect` wrote.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_on_detection(
    handle: *mut TautscopeLoop,
    detection: *const TautscopeDetection,
    captured_at: f64,
    report: *mut TautscopeReport,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        unsafe { check_report(report) }?;
        check_finite("captured_at", captured_at)?;
        // SAFETY: the caller's contract.
        let detection = unsafe { read("detection", detection) }?;
        let done = handle.on_detection(detection, captured_at)?;
        // SAFETY: checked above.
        unsafe { write_report(report, &done) };
        Ok(())
    })
}

/// Image update: predicts the state, detects the bands, and updates the estimates.
///
/// It takes some ms, in which the loop cannot step. To detect in another thread, call its three parts:
/// `tautscope_loop_predict_state`, `tautscope_detector_detect` in that thread, and `tautscope_loop_on_detection`.
///
/// # Safety
/// Both handles are valid and used by this thread only; `image` and its pixels are readable; `report` as in
/// `tautscope_loop_on_features`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_on_frame(
    handle: *mut TautscopeLoop,
    detector: *mut TautscopeDetector,
    image: *const TautscopeImage,
    captured_at: f64,
    report: *mut TautscopeReport,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        unsafe { check_report(report) }?;
        check_finite("captured_at", captured_at)?;
        let prediction = handle.predict(captured_at);
        let mut detection = None;
        // SAFETY: the caller's contract.
        let result = with_handle(unsafe { detector.as_mut() }, |detector| {
            // SAFETY: the caller's contract.
            detection = Some(unsafe { detect(detector, image, Some(&prediction)) }?);
            Ok(())
        });
        let Some(detection) = detection else {
            return Err(result);
        };
        let done = handle.on_detection(&detection, captured_at)?;
        // SAFETY: checked above.
        unsafe { write_report(report, &done) };
        Ok(())
    })
}

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
        *unsafe { write("supervision", supervision) }? =
            on_loop!(handle, inner => inner.supervision()).into();
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
        on_loop!(handle, inner => inner.engage());
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
        on_loop!(handle, inner => inner.acknowledge());
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
        on_loop!(handle, inner => inner.set_compensation(share))
            .map_err(|error| failed(TautscopeResult::Signal, format_args!("{error}")))
    })
}

/// Raises a `TautscopeFlag` that only the rig can detect. `DRIVE_FAULT` stops the motion; the reaction is then `QUICK_STOP`,
/// until `tautscope_loop_engage`.
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
        let known = core::Flag::ALL.get(flag as usize);
        let known = known.ok_or_else(|| {
            failed(
                TautscopeResult::Signal,
                format_args!("flag: got {flag}, expected a TautscopeFlag"),
            )
        })?;
        on_loop!(handle, inner => inner.raise(*known));
        Ok(())
    })
}

fn check_finite(name: &str, value: f64) -> Result<(), TautscopeResult> {
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

/// Checks that the features of each band that was found are finite.
fn check_bands(features: &[f64; 4], is_found: [bool; 2]) -> Result<(), TautscopeResult> {
    for (band, is_found) in features.chunks(2).zip(is_found) {
        for value in band.iter().filter(|_| is_found) {
            check_finite("features", *value)?;
        }
    }
    Ok(())
}

/// Checks the size of the caller's report.
///
/// # Safety
/// It is null, or `size` is readable.
unsafe fn check_report(report: *const TautscopeReport) -> Result<(), TautscopeResult> {
    if report.is_null() {
        return Ok(());
    }
    // SAFETY: the caller's contract.
    let size = unsafe { (&raw const (*report).size).read() } as usize;
    let needed = size_of::<TautscopeReport>();
    if size < needed {
        return Err(failed(
            TautscopeResult::Size,
            format_args!("report.size: got {size}, expected at least {needed}"),
        ));
    }
    Ok(())
}

/// Writes a report, all but its size.
///
/// # Safety
/// [`check_report`] accepted it.
unsafe fn write_report(report: *mut TautscopeReport, done: &TautscopeReport) {
    if report.is_null() {
        return;
    }
    let start = offset_of!(TautscopeReport, status);
    // SAFETY: both have this size, of which none is padding, and do not overlap.
    unsafe {
        let from = std::ptr::from_ref(done).cast::<u8>().add(start);
        let count = size_of::<TautscopeReport>() - start;
        from.copy_to_nonoverlapping(report.cast::<u8>().add(start), count);
    }
}
