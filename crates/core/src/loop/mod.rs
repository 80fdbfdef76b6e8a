//! The whole loop, Fig. 6.

pub(crate) mod axis;
pub(crate) mod history;
pub(crate) mod reduction;
