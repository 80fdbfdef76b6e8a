//! What is known of the offsets before anything was measured.

use crate::error::{ConfigError, require, require_non_negative, require_positive};

/// What is known beforehand of how a contact offset varies; all in the unit of the DOF.
///
/// The offset at position y is a level, common to all positions, plus a tilt, plus a local
/// deviation that is alike at neighbouring positions. All are normal and wander as the command
/// travels:
///
/// ```text
/// cov(delta(y), delta(y')) = level^2 + tilt^2 y y' + local^2 exp(-|y - y'| / correlation)
/// drift per travel d:        d times the same of level_drift, tilt_drift, local_drift
/// ```
///
/// Friction moves both contacts outwards alike, so the levels of the two offsets are correlated
/// with -`symmetry`, and so are their drifts. The tilt is the same of both. The local parts have
/// nothing to do with each other.
///
/// A change of the level is what a straightened scope does. A tip that follows with a gain g in
/// contact has offsets of tilt 1/g - 1. What is local is a stretched cable, a shaft that has taken a
/// set, or one cable handing over to the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetPrior {
    /// Distance of two nodes; 33 of them, centred where the run starts, hold the function.
    pub spacing: f64,
    /// Standard deviation of the level before the first measurement, and the largest ever.
    pub level: f64,
    /// Standard deviation of the tilt, a number; 0 says that tip and command have one scale.
    pub tilt: f64,
    /// Standard deviation of the local part.
    pub local: f64,
    /// Distance over which the local part is alike.
    pub correlation: f64,
    /// Standard deviation of the level's change over a travel of 1, in the DOF's unit.
    pub level_drift: f64,
    /// The same of the tilt.
    pub tilt_drift: f64,
    /// The same of the local part.
    pub local_drift: f64,
    /// Minus the correlation of the two levels: 0, independent, to 1.
    pub symmetry: f64,
}

impl OffsetPrior {
    /// The same, checked.
    ///
    /// # Errors
    /// A deviation is negative, a distance not above 0, or one of them is not finite.
    pub fn checked(self) -> Result<Self, ConfigError> {
        require_positive("spacing", self.spacing)?;
        require_positive("level", self.level)?;
        require_non_negative("tilt", self.tilt)?;
        require_non_negative("local", self.local)?;
        require_positive("correlation", self.correlation)?;
        require_non_negative("level_drift", self.level_drift)?;
        require_non_negative("tilt_drift", self.tilt_drift)?;
        require_non_negative("local_drift", self.local_drift)?;
        let share = (0.0..1.0).contains(&self.symmetry);
        require(share, "symmetry", self.symmetry, "at least 0, below 1")?;
        Ok(self)
    }
}
