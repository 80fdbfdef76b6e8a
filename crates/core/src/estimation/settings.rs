//! Settings of the state estimation of profile `best`.

/// State estimation of profile `best`, decision 0018. Names and units are those of the TOML keys.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct StateEstimationSettings {
    /// Standard deviation in px of a marker without a covariance.
    pub marker_deviation: f64,
    /// Standard deviation in px of the feature model beyond the markers' covariance.
    pub model_deviation: f64,
    /// Standard deviation in m of the tip's displacement across the bend by uneven curvature.
    pub sideways_deviation: f64,
    /// Mahalanobis distance beyond which a marker is an outlier; infinite: never.
    pub outlier_distance: f64,
    /// Gauss-Newton steps, at most.
    pub steps: u32,
    /// Standard deviation of the motion of an idle tip between two images, in `update_distance`.
    pub rest_deviation: f64,
    /// Time constant in s with which a tip comes to rest after its command.
    pub settling_time: f64,
}
