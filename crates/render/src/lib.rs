//! Images of the twin: a flexible instrument as a swept tube over tissue, drawn on the CPU.
//!
//! It is independent of the loop under test: it has its own projection, and its input is not the bending
//! angle but frames along a centreline. Lengths in m, angles in rad, pixels with whole
//! numbers at their centres, colours in the order blue, green, red.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "pixel counts and grey levels are far below where these casts lose anything"
)]

mod curve;
mod error;
mod features;
mod lens;
mod material;
mod noise;
mod pose;
mod raster;
mod renderer;
mod tube;
mod vector;

pub use error::Error;
pub use features::{Piece, Truth};
pub use lens::Lens;
pub use pose::Pose;
pub use renderer::Renderer;
pub use tube::Geometry;
