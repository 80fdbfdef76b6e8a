//! Pixels to runs and regions: the pixel formats, Eq. (12), the low-pass, the threshold, connected components.

mod active_blocks;
mod discriminant;
mod filter;
mod format;
mod frame;
mod lowpass;
mod projection;
mod regions;
mod row;
mod run_map;
mod runs;
mod scanner;
mod segment;
mod simd_gather;

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod byte_dot;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod simd_dot;
#[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
#[path = "no_simd_dot.rs"]
mod simd_dot;

pub(crate) use discriminant::Affine;
pub use discriminant::ColorDiscriminant;
pub use format::{MAX_SIDE, PixelFormat};
pub use frame::{Frame, Image, Window};
pub use regions::{Labeller, Region};
pub(crate) use row::Row;
pub(crate) use run_map::RunMap;
pub use runs::Runs;
pub use scanner::MAX_REGIONS;
pub(crate) use scanner::{Regions, Scanner};
pub use segment::Segmenter;
