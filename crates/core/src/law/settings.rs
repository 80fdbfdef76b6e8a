//! Settings of the compensation law of profile `best`.

/// Compensation of profile `best`. Names are those of the TOML keys; travels are in units of the DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct LawSettings {
    /// `K_b`: largest speed of the command over that of the reference.
    pub free_gain: f64,
    /// Largest speed of the predicted tip over that of the reference.
    pub tip_gain: f64,
    /// Half of the travel of the reference in which its direction reverses.
    pub direction_travel: f64,
    /// Largest change of the contact offsets and of the predicted tip in use, per travel of the reference.
    pub change_rate: f64,
}
