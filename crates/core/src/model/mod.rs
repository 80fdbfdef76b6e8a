//! Models: hysteresis of the three DOFs; bands in an image, Eqs. (7)-(11).

pub(crate) mod camera;
pub(crate) mod features;
pub(crate) mod friction;
pub(crate) mod geometry_error;
pub(crate) mod hysteresis;
pub(crate) mod instrument;
pub(crate) mod outline;
pub(crate) mod plays;
pub(crate) mod section;
pub(crate) mod settings;
pub(crate) mod slack;
