//! `TautscopeDetector`: the marker bands in an image, Eq. (12) and Fig. 5.
#![allow(unsafe_code)]

use std::sync::Arc;

use tautscope_band_prediction::{ModelPredictor, Prior, Workspace, outlines};
use tautscope_core as core;
use tautscope_vision::{Detector, Frame, Image, PixelFormat, PostureTable};

use crate::document::{config, detector_settings};
use crate::pointers::{bytes, give, read, take_back, write};
use crate::result::{Handle, TautscopeResult, failed, guarded, with_handle};
use crate::types::{
    TautscopeDetection, TautscopeImage, TautscopeRejection, TautscopeStatePrediction,
};

/// Every how many lines of an image one is in its checksum.
const CHECKSUM_STEP: usize = 8;

/// Finds the two marker bands in images. No result depends on earlier images.
pub struct TautscopeDetector {
    detector: Detector,
    model: core::FeatureModel,
    model_deviation: f64,
    workspace: Workspace,
    size: [u32; 2],
    format: PixelFormat,
    is_broken: bool,
}

impl Handle for TautscopeDetector {
    fn is_broken(&mut self) -> &mut bool {
        &mut self.is_broken
    }
}

impl TautscopeDetector {
    fn new(text: &[u8]) -> Result<Self, TautscopeResult> {
        let (document, model, format) = detector_settings(text)?;
        let postures = document.experiment.postures();
        let outlines = postures
            .iter()
            .filter_map(|posture| outlines(&model, *posture));
        let model_deviation = document.vision.model_deviation;
        let detector = Detector::new(document.vision)
            .map_err(|error| config(format_args!("vision.{error}")))?
            .with_workspace(Arc::new(PostureTable::new(outlines)));
        let (states, std) = document.experiment.starts();
        Ok(Self {
            detector,
            model,
            model_deviation,
            workspace: Workspace { states, std },
            size: [document.camera.width, document.camera.height],
            format,
            is_broken: false,
        })
    }
}

/// Creates a detector.
///
/// `toml` is the configuration as in `tautscope_loop_create`. `*created` is the detector; destroy it with
/// `tautscope_detector_destroy`.
///
/// # Safety
/// `toml` points to `length` readable bytes; `created` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_detector_create(
    toml: *const u8,
    length: usize,
    created: *mut *mut TautscopeDetector,
) -> TautscopeResult {
    guarded(|| {
        // SAFETY: the caller's contract.
        let text = unsafe { bytes("toml", toml, length) }?;
        // SAFETY: the caller's contract.
        unsafe { give(created, TautscopeDetector::new(text)?) }
    })
}

/// Destroys a detector; null is ignored.
///
/// # Safety
/// The detector came from `tautscope_detector_create` and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_detector_destroy(handle: *mut TautscopeDetector) {
    // SAFETY: the caller's contract.
    unsafe { take_back(handle) };
}

/// Detects the bands in an image. It allocates only for an image that is larger than those before.
///
/// `prediction` is from `tautscope_loop_predict_state`; without one (null, or not known) the whole workspace is searched.
///
/// # Safety
/// The handle is valid and used by this thread only; `image` and its pixels are readable, `prediction` is null or readable,
/// `detection` is writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_detector_detect(
    handle: *mut TautscopeDetector,
    image: *const TautscopeImage,
    prediction: *const TautscopeStatePrediction,
    detection: *mut TautscopeDetection,
) -> TautscopeResult {
    // SAFETY: the caller's contract.
    with_handle(unsafe { handle.as_mut() }, |handle| {
        // SAFETY: the caller's contract.
        let (place, prediction) = unsafe { (write("detection", detection)?, prediction.as_ref()) };
        // SAFETY: the caller's contract.
        *place = unsafe { detect(handle, image, prediction) }?;
        Ok(())
    })
}

/// Detects the bands in an image, as [`tautscope_detector_detect`].
///
/// # Safety
/// `image` is null, or it and its pixels are readable.
pub unsafe fn detect(
    handle: &mut TautscopeDetector,
    image: *const TautscopeImage,
    prediction: Option<&TautscopeStatePrediction>,
) -> Result<TautscopeDetection, TautscopeResult> {
    // SAFETY: the caller's contract.
    let image = unsafe { read("image", image) }?;
    // SAFETY: the caller's contract.
    let data = unsafe { bytes("image.data", image.data, image.length) }?;
    let [width, height] = handle.size;
    let format = handle.format;
    let is_configured = [image.width, image.height] == handle.size && image.format == format as u32;
    if !is_configured {
        return Err(failed(
            TautscopeResult::Image,
            format_args!(
                "image: got {} x {} px of format {}, expected {width} x {height} px of format {} ({})",
                image.width,
                image.height,
                image.format,
                format as u32,
                format.name()
            ),
        ));
    }
    let sides = [width, height].map(|side| side as usize);
    let frame = Image::new(data, format, sides, image.stride)
        .map_err(|error| failed(TautscopeResult::Image, format_args!("image.{error}")))?;
    let prediction = prediction.filter(|prediction| prediction.is_known != 0);
    if prediction.is_some_and(|prediction| {
        let known = prediction.state.iter().chain(&prediction.std);
        let mut numbers = known.chain(&prediction.geometry);
        !numbers.all(|number| number.is_finite())
    }) {
        return Err(failed(
            TautscopeResult::Signal,
            format_args!("prediction: got {prediction:?}, expected finite numbers"),
        ));
    }
    let prior = prediction.map(|known| Prior {
        state: known.state,
        std: known.std,
        geometry: known.geometry,
    });
    let TautscopeDetector {
        detector,
        model,
        model_deviation,
        workspace,
        ..
    } = handle;
    let predictor = ModelPredictor::new(model, *model_deviation, workspace, prior);
    let (found, _) = detector.recognise(&frame, &predictor);
    Ok(TautscopeDetection {
        features: found.features,
        covariance: found.covariance,
        rejections: found
            .rejections
            .map(|reason| TautscopeRejection::from(reason) as u32),
        discriminant: u32::try_from(found.discriminant).unwrap_or(u32::MAX),
        checksum: checksum(&frame),
    })
}

/// Checksum of every eighth line: `checksum` of `python/tautscope/loop/safety.py`.
fn checksum(frame: &impl Frame) -> u32 {
    let mut checksum = crc32fast::Hasher::new();
    let lines = frame.format().lines(frame.height());
    for index in (0..lines).step_by(CHECKSUM_STEP) {
        checksum.update(frame.line(index));
    }
    checksum.finalize()
}
