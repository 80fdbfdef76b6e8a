//! Settings of the compensation law of profile `best`.

use crate::dof::PerDof;

/// Compensation of profile `best`, decision 0029. Names are those of the TOML keys; travels and half widths are in half
/// of `width_limit` of the DOF, so that one set serves all three.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct AdaptiveSettings {
    /// Largest speed of the predicted tip over that of the reference.
    pub tip_gain: f64,
    /// Standard deviations of the half width by which less of it is compensated than estimated.
    pub caution: f64,
    /// Time constant of the low-pass filter of the operator input that separates tremor from motion, in s.
    pub tremor_time: f64,
    /// Travel of the reference over which its direction is averaged.
    pub direction_travel: f64,
    /// Rate limit of half width and centre in the compensation, per s of motion, for each DOF.
    pub change_rate: PerDof<f64>,
    /// Travel of the reference up to which nothing is limited.
    pub known_travel: f64,
}
