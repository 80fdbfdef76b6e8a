#![doc = include_str!("../README.md")]

mod any_loop;
mod axes;
#[cfg(feature = "toml")]
mod document;
#[cfg(feature = "toml")]
mod error;
#[cfg(feature = "toml")]
mod ranges;

pub use any_loop::{AnyLoop, Profile, Selection};
pub use axes::{AxesSettings, AxisSettings, MOST_RANGE, OFFSET_LIMIT, SPEED};
#[cfg(feature = "toml")]
pub use document::{Configuration, Dof};
#[cfg(feature = "toml")]
pub use error::Error;
