//! State prediction and state estimation.

pub(crate) mod axis_filter;
pub(crate) mod estimate;
pub(crate) mod estimate_settings;
pub(crate) mod expectation;
pub(crate) mod history;
pub(crate) mod kalman;
pub(crate) mod measurement;
pub(crate) mod state_prediction;
