//! Bands whose edges are blurred away: a model of the image intensity is fitted instead of outlines.

mod equations;
mod fitter;
mod mask;
mod patch;
#[cfg(test)]
mod tests;

pub(crate) use fitter::{BlurFit, BlurFitter};
