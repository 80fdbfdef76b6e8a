//! The whole loop, Fig. 6.

pub(crate) mod any_loop;
pub(crate) mod axes;
pub(crate) mod bands;
pub(crate) mod best;
pub(crate) mod image_update;
pub(crate) mod measurement;
pub(crate) mod observation;
pub(crate) mod paper;
pub(crate) mod profile;
pub(crate) mod reduction;
pub(crate) mod report;
pub(crate) mod settings;
