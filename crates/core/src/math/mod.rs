//! Vectors and small linear systems.

pub(crate) mod linear;
