//! Image to markers: Eq. (12) and Fig. 5 of Reilink et al. 2013.
//!
//! One pass over the frame. Each row is projected onto the colour discriminant ([`discriminant`]),
//! low-passed and thresholded into runs ([`segment`]); the runs join into regions
//! ([`regions`]); what looks like a band where one is expected is a marker ([`judge`]). [`detector`] holds it together.
//!
//! Pixel coordinates are those of `OpenCV`: u to the right, v down, the centre of the first pixel is (0, 0).

// Kernels are compiled once for each instruction set, which they are only if they are inlined.
#![allow(clippy::inline_always)]

pub mod blend;
mod columns;
pub mod detector;
pub mod discriminant;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod dot;
pub mod error;
pub mod evidence;
pub mod expectation;
pub mod fit;
pub mod format;
pub mod frame;
pub mod judge;
mod layer;
mod linear;
mod lowpass;
mod numbers;
mod pairing;
mod pairs;
mod patch;
mod projection;
pub mod regions;
pub mod rejection;
pub mod runmap;
pub mod runs;
mod samples;
pub mod segment;
mod triples;
pub mod verdict;

pub use detector::{Detector, Settings};
pub use discriminant::ColorDiscriminant;
pub use error::Error;
pub use evidence::{Demands, Evidence};
pub use expectation::{Expect, Expectation, OUTLINE, Outline};
pub use format::PixelFormat;
pub use frame::{Frame, Image, Window};
pub use regions::{Labeller, Region};
pub use rejection::Rejection;
pub use runmap::RunMap;
pub use segment::Segmenter;
pub use verdict::Verdict;
