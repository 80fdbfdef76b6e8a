//! Settings that several blocks share.

/// One degree of freedom. Names, units and meaning are those of `python/tautscope/config/control.py`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct DofSettings {
    /// τ: command travel between two estimator updates [m or rad].
    pub update_distance: f64,
    /// Largest standard deviation of the state per px of marker noise at which the DOF is observable [m/px or rad/px].
    pub observable_deviation: f64,
    /// Width of the slack that is expected [m or rad]: three quarters of it are the unit of profile `best`.
    pub expected_width: f64,
    /// Standard deviation of the tip about the reference before the first image [m or rad].
    pub start_deviation: f64,
    /// `K_b`: command over reference while the slack is crossed.
    pub free_gain: f64,
    /// Upper bound of every gain.
    pub gain_limit: f64,
    /// Share of the reference's travel by which the command returns to the reference after changed offsets.
    pub recovery: f64,
    /// ε in Eq. (4): contact tolerance.
    pub contact_tolerance: f64,
    /// α in Eq. (6): smoothing factor, per `update_distance` travelled.
    pub smoothing_factor: f64,
    /// Initial offset at the negative contact [m or rad].
    pub delta_minus: f64,
    /// Initial offset at the positive contact [m or rad], not below `delta_minus`.
    pub delta_plus: f64,
}

/// The loop's clock. Names, units and meaning are those of `python/tautscope/config/control.py`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct ControlSettings {
    /// Control period in s.
    pub period: f64,
    /// Time for which control ticks are stored, in s.
    pub history: f64,
}
