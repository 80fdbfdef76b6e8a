//! Vectors and small linear systems.

pub(crate) mod linear;
pub(crate) mod whitening;
