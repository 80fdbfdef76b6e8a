//! Compensation law of profile `best`.

pub(crate) mod lag_lead;
pub(crate) mod offset_rate_limit;
pub(crate) mod predicted_tip;
pub(crate) mod settings;
pub(crate) mod slip_direction;
pub(crate) mod smoother;
pub(crate) mod vector_law;
