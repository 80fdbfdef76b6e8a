//! Regions to bands: outlines are fitted to the marker pixels, scored, and accepted or rejected with a reason.

mod contour;
mod fit;
mod outcome;
mod outline;
mod pairing;
mod prediction;
mod rejection;
mod score;
mod search;

pub use outcome::Recognition;
pub use outline::{OUTLINE_CORNERS, Outline};
pub use prediction::{BandPrediction, BandPredictor};
pub use rejection::Rejection;
pub use score::BandScore;
pub(crate) use search::OutlineSearch;
