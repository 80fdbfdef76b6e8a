//! Bands whose edges are blurred away: a model of the image intensity is fitted instead of outlines.

mod equations;
mod fit;
mod fitter;
mod mask;
mod patch;

pub(crate) use fit::BlurFit;
pub(crate) use fitter::BlurFitter;
