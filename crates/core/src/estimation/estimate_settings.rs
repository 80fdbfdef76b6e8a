//! Settings of the estimate of profile `best`.

use crate::error::{ConfigError, require, require_all_positive, require_non_negative};

/// The estimate of profile `best`. Names and units are those of the TOML keys; lengths and travels are in units of the DOF:
/// three quarters of its `expected_width`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct EstimateSettings {
    /// Standard deviation in px of a marker without a covariance.
    pub marker_deviation: f64,
    /// Standard deviation of the unevenness of the section's curvature.
    pub shape_deviation: f64,
    /// Standard deviation in px of a shift of the image, by an error of the camera's pose or principal point.
    pub image_deviation: f64,
    /// Standard deviation in px of what else the feature model errs.
    pub misfit_deviation: f64,
    /// Travel within which it errs alike.
    pub misfit_travel: f64,
    /// Mahalanobis distance beyond which a marker is an outlier.
    pub outlier_distance: f64,
    /// Standard deviation of the weight of a play.
    pub weight_deviation: f64,
    /// Standard deviation of the offset.
    pub offset_deviation: f64,
    /// Standard deviation of the tip that is new in each image.
    pub tip_deviation: f64,
    /// Travel over which a weight returns to its prior.
    pub weight_travel: f64,
    /// Travel over which the offset returns to its prior.
    pub offset_travel: f64,
}

impl EstimateSettings {
    /// Checks the range of every setting.
    ///
    /// # Errors
    /// One is out of range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        require_all_positive(&[
            ("marker_deviation", &[self.marker_deviation]),
            ("weight_deviation", &[self.weight_deviation]),
            ("tip_deviation", &[self.tip_deviation]),
            ("weight_travel", &[self.weight_travel]),
            ("offset_travel", &[self.offset_travel]),
            ("misfit_travel", &[self.misfit_travel]),
        ])?;
        for (field, value) in [
            ("shape_deviation", self.shape_deviation),
            ("image_deviation", self.image_deviation),
            ("offset_deviation", self.offset_deviation),
            ("misfit_deviation", self.misfit_deviation),
        ] {
            require_non_negative(field, value)?;
        }
        let outlier = self.outlier_distance;
        require(outlier > 0.0, "outlier_distance", outlier, "above 0")
    }
}
