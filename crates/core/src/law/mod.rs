//! Compensation law of profile `plays`.

pub(crate) mod direction;
pub(crate) mod settings;
pub(crate) mod vector_law;
