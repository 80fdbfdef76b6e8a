//! Regions to bands: outlines are fitted to the marker pixels, scored, and accepted or rejected with a reason.

mod contour;
mod fit;
mod outcome;
mod outline;
mod posture_table;
mod prediction;
mod rejection;
mod score;
mod search;
mod starts;
mod surroundings;

pub use outcome::Recognition;
pub(crate) use outline::extent;
pub use outline::{OUTLINE_CORNERS, Outline};
pub use posture_table::PostureTable;
pub(crate) use posture_table::{BLOBS, BlobPostures};
pub use prediction::{BandPrediction, BandPredictor, SECTION_DISCS, SectionDisc};
pub use rejection::Rejection;
pub use score::BandScore;
pub(crate) use search::OutlineSearch;
pub(crate) use surroundings::LEAST_CONTRAST;
