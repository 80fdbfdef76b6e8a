//! Image updates of `TautscopeLoop`: by features, by a detection, or by an image.
#![allow(unsafe_code)]

use crate::detector::{TautscopeDetector, detect};
use crate::pointers::{check_report, read, write, write_report};
use crate::reduction::{TautscopeLoop, check_finite};
use crate::result::{TautscopeResult, failed, with_handle};
use crate::types::{
    TautscopeDetection, TautscopeImage, TautscopeRejection, TautscopeReport,
    TautscopeStatePrediction,
};

impl TautscopeLoop {
    fn update(
        &mut self,
        features: Option<[f64; 4]>,
        covariance: Option<&[[f64; 4]; 4]>,
        captured_at: f64,
        checksum: Option<u64>,
    ) -> Result<TautscopeReport, TautscopeResult> {
        let bands = self.bands()?;
        let report = bands.on_features(features, covariance, captured_at, checksum);
        Ok(TautscopeReport::new(&report, captured_at))
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
        self.update(
            found.then_some(detection.features),
            found.then_some(&detection.covariance),
            captured_at,
            Some(detection.checksum.into()),
        )
    }

    fn predict(&mut self, captured_at: f64) -> Result<TautscopeStatePrediction, TautscopeResult> {
        let bands = self.bands()?;
        let known = bands.predict_state(captured_at);
        Ok(TautscopeStatePrediction {
            state: known.map_or([f64::NAN; 3], |known| known.state),
            std: known.map_or([f64::NAN; 3], |known| known.deviation),
            geometry: bands.geometry().map_or([0.0; 3], |found| found.errors()),
            is_known: known.is_some().into(),
        })
    }
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
    let handle = unsafe { handle.as_mut() };
    let update = |handle: &mut TautscopeLoop| {
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
        handle.update(features.copied(), None, captured_at, None)
    };
    // SAFETY: the caller's contract.
    unsafe { report_update(handle, captured_at, report, update) }
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
        *unsafe { write("prediction", prediction) }? = handle.predict(captured_at)?;
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
    let handle = unsafe { handle.as_mut() };
    let update = |handle: &mut TautscopeLoop| {
        // SAFETY: the caller's contract.
        let detection = unsafe { read("detection", detection) }?;
        handle.on_detection(detection, captured_at)
    };
    // SAFETY: the caller's contract.
    unsafe { report_update(handle, captured_at, report, update) }
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
    let handle = unsafe { handle.as_mut() };
    let update = |handle: &mut TautscopeLoop| {
        let prediction = handle.predict(captured_at)?;
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
        handle.on_detection(&detection, captured_at)
    };
    // SAFETY: the caller's contract.
    unsafe { report_update(handle, captured_at, report, update) }
}

/// Updates a loop by an image, and writes the report.
///
/// # Safety
/// `report` is null or points to as many writable bytes as its member `size` states.
unsafe fn report_update(
    handle: Option<&mut TautscopeLoop>,
    captured_at: f64,
    report: *mut TautscopeReport,
    update: impl FnOnce(&mut TautscopeLoop) -> Result<TautscopeReport, TautscopeResult>,
) -> TautscopeResult {
    with_handle(handle, |handle| {
        // SAFETY: the caller's contract.
        unsafe { check_report(report) }?;
        check_finite("captured_at", captured_at)?;
        let done = update(handle)?;
        // SAFETY: checked above.
        unsafe { write_report(report, &done) };
        Ok(())
    })
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
