//! Image to markers: Eq. (12) and Fig. 5 of Reilink et al. 2013.
//!
//! One pass over the frame. Each row is projected onto the colour discriminant ([`discriminant`]),
//! low-passed ([`lowpass`]) and thresholded into runs ([`segment`]); the runs join into regions
//! ([`regions`]); two regions are the markers A and B ([`markers`]). [`detector`] holds it together.
//!
//! Pixel coordinates are those of `OpenCV`: u to the right, v down, the centre of the first pixel is (0, 0).

pub mod detector;
pub mod discriminant;
pub mod error;
pub mod expectation;
pub mod fit;
pub mod frame;
pub mod judge;
mod linear;
pub mod lowpass;
pub mod markers;
pub mod regions;
pub mod runmap;
pub mod segment;

pub use detector::{Detection, Detector, Settings};
pub use discriminant::ColorDiscriminant;
pub use error::Error;
pub use expectation::{Expect, Expectation, OUTLINE, Outline};
pub use frame::{BgrFrame, Frame};
pub use judge::{Demands, Evidence, Verdict};
pub use markers::Rejection;
pub use regions::{Labeller, Region};
pub use runmap::RunMap;
pub use segment::Segmenter;
