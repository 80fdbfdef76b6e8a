//! State prediction and state estimation.

pub(crate) mod centre_map;
pub(crate) mod ensemble;
pub(crate) mod expectation;
pub(crate) mod filter;
pub(crate) mod gain;
pub(crate) mod history;
pub(crate) mod marker_measurement;
pub(crate) mod posture;
pub(crate) mod settings;
pub(crate) mod tip_filter;
pub(crate) mod whereabouts;
