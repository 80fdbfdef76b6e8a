//! State estimation of profile `best`.

pub(crate) mod expectation;
pub(crate) mod history;
pub(crate) mod normal_equations;
pub(crate) mod posture;
pub(crate) mod settings;
pub(crate) mod sight;
pub(crate) mod weighted;
pub(crate) mod whereabouts;
