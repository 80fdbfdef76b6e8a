//! The article's blocks: play, compensator, estimator, state estimation, Eqs. (1)-(6) and (13)-(16).

pub(crate) mod compensator;
pub(crate) mod estimator;
pub(crate) mod play;
pub(crate) mod play_limit;
pub(crate) mod state;
