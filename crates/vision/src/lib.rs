//! Marker detection: camera image to marker positions, Eq. (12) and Fig. 5 of Reilink et al. 2013.
//!
//! `scan` turns a frame into runs and regions of marker pixels in one pass, `recognition` fits the outlines of both
//! bands to them and decides whether they are the markers, and `blur` fits the image intensity where blur has
//! left no edges. [`Detector`] runs the three. Each may use the ones named before it, never the other way round.
//!
//! Pixel coordinates are those of `OpenCV`: u to the right, v down, the centre of the first pixel is (0, 0).

// Kernels are compiled once for each instruction set, which they are only if they are inlined.
#![allow(clippy::inline_always)]

mod blur;
mod detector;
mod error;
mod frame_search;
mod math;
mod recognition;
mod scan;
mod settings;

pub use detector::Detector;
pub use error::Error;
pub use recognition::{
    BandPrediction, BandPredictor, BandScore, OUTLINE_CORNERS, Outline, PostureTable, Recognition,
    Rejection, SECTION_DISCS, SectionDisc,
};
pub use scan::{
    ColorDiscriminant, Frame, Image, Labeller, MAX_REGIONS, MAX_SIDE, PixelFormat, Region, Runs,
    Segmenter, Window,
};
pub use settings::{BlurSettings, ClearSettings, FitSettings, Settings, UnlocatedSettings};
