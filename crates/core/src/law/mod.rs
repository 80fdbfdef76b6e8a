//! Compensation law of profile `best`.

pub(crate) mod direction;
pub(crate) mod settings;
pub(crate) mod vector_law;
