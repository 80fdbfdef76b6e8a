//! Compensation of profile `best`.

pub(crate) mod axis;
pub(crate) mod contact;
pub(crate) mod friction;
pub(crate) mod lead;
pub(crate) mod offset_map;
pub(crate) mod parameters;
pub(crate) mod settings;
pub(crate) mod sharing;
pub(crate) mod slack;
pub(crate) mod smoother;
pub(crate) mod withheld;
