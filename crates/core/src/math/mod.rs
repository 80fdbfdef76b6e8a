//! Vectors and small linear systems.

pub(crate) mod linear;
pub(crate) mod random;
pub(crate) mod whitening;
