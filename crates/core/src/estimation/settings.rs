//! Settings of the state estimation of profile `best`.

use crate::dof::PerDof;
use crate::error::{ConfigError, require, require_non_negative, require_positive};

/// The estimate of profile `best`, decision 0030. Names and units are those of the TOML keys; half widths and travels
/// are in half of `width_limit`, so that one set serves all DOFs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct StateEstimationSettings {
    /// Standard deviation in px of a marker without a covariance.
    pub marker_deviation: f64,
    /// Standard deviation in px of the feature model beyond the markers' covariance.
    pub model_deviation: f64,
    /// Standard deviation of the unevenness of the section's curvature, [`Instrument::with_unevenness`].
    ///
    /// [`Instrument::with_unevenness`]: crate::model::instrument::Instrument::with_unevenness
    pub shape_deviation: f64,
    /// Standard deviation in px of a shift of the image, by an error of the camera's pose or principal point.
    pub image_deviation: f64,
    /// Mahalanobis distance beyond which a marker is an outlier.
    pub outlier_distance: f64,
    /// Standard deviation of the tip from the plays, by rounding of the loop and viscous friction.
    pub tip_deviation: f64,
    /// Standard deviation of the logarithm of the initial half width.
    pub width_deviation: f64,
    /// Standard deviation of the initial centre of the contact offsets.
    pub centre_deviation: f64,
    /// Standard deviation of the initial share of the friction that insertion and rotation have in common.
    pub share_deviation: f64,
    /// Mean and standard deviation in s of the initial lag of the tip behind the plays.
    pub lag_deviation: f64,
    /// Standard deviation of the random walk of the tip over a travel of 1, in half widths.
    pub tip_walk: f64,
    /// The same of the logarithm of the half width.
    pub width_walk: f64,
    /// The same of the centre, in half widths.
    pub centre_walk: f64,
    /// The same of the share.
    pub share_walk: f64,
    /// Share of the centre that its map over the position takes over per travel 1, for each DOF.
    pub map_rate: PerDof<f64>,
    /// Standard deviation of the gain from 1.
    pub gain_deviation: f64,
}

impl StateEstimationSettings {
    /// Checks the range of every setting.
    ///
    /// # Errors
    /// One is out of range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        for (field, value) in [
            ("marker_deviation", self.marker_deviation),
            ("tip_deviation", self.tip_deviation),
            ("width_deviation", self.width_deviation),
            ("gain_deviation", self.gain_deviation),
        ] {
            require_positive(field, value)?;
        }
        for (field, value) in [
            ("model_deviation", self.model_deviation),
            ("shape_deviation", self.shape_deviation),
            ("image_deviation", self.image_deviation),
            ("centre_deviation", self.centre_deviation),
            ("share_deviation", self.share_deviation),
            ("lag_deviation", self.lag_deviation),
            ("tip_walk", self.tip_walk),
            ("width_walk", self.width_walk),
            ("centre_walk", self.centre_walk),
            ("share_walk", self.share_walk),
        ] {
            require_non_negative(field, value)?;
        }
        for rate in self.map_rate {
            require_non_negative("map_rate", rate)?;
        }
        let outlier = self.outlier_distance;
        require(outlier > 0.0, "outlier_distance", outlier, "above 0")
    }
}
