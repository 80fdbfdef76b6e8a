//! Settings that several blocks read: of a DOF, and of the control loop. Names and units are those of the TOML keys.

/// One DOF: its compensator, Eqs. (2)-(3), its estimator, Eqs. (4)-(6), and its scale; in m or rad.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct DofSettings {
    /// tau: travel of the command between two updates of the estimator.
    pub update_distance: f64,
    /// Largest standard deviation of the state per px of marker noise of an observable DOF [m/px, rad/px].
    pub observable_deviation: f64,
    /// Standard deviation of the tip's distance from the reference before the first image.
    pub start_deviation: f64,
    /// `K_b`: command over reference in the free zone.
    pub free_gain: f64,
    /// Upper bound of every gain.
    pub gain_limit: f64,
    /// Return of the compensator's anchor to zero, as a share of the reference's travel.
    pub recovery: f64,
    /// epsilon of Eq. (4).
    pub contact_tolerance: f64,
    /// alpha of Eq. (6).
    pub smoothing_factor: f64,
    /// Contact offset at the start.
    pub delta_minus: f64,
    /// Contact offset at the start, not below `delta_minus`.
    pub delta_plus: f64,
}

/// The loop's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct ControlSettings {
    /// Control period in s.
    pub period: f64,
    /// How long control ticks are remembered, in s.
    pub history: f64,
}
