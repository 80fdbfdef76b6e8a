//! Models of the bands in an image: kinematics, camera, features, outlines, Eqs. (7)-(11).

pub(crate) mod camera;
pub(crate) mod features;
pub(crate) mod instrument;
pub(crate) mod outline;
pub(crate) mod settings;
