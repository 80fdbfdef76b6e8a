//! State prediction and state estimation.

pub(crate) mod axis_filter;
pub(crate) mod centre_map;
pub(crate) mod ensemble;
pub(crate) mod estimate;
pub(crate) mod estimate_settings;
pub(crate) mod expectation;
pub(crate) mod filter;
pub(crate) mod filter_belief;
pub(crate) mod filter_motion;
pub(crate) mod filter_update;
pub(crate) mod history;
pub(crate) mod kalman;
pub(crate) mod marker_measurement;
pub(crate) mod measurement;
pub(crate) mod nominal;
pub(crate) mod path;
pub(crate) mod posture;
pub(crate) mod settings;
pub(crate) mod state_prediction;
pub(crate) mod tip_regression;
