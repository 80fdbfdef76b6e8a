//! Result of the intensity fit.

use crate::math::{Square, points};
use crate::recognition::{BandScore, Outline, Recognition};
use crate::scan::RunMap;
use crate::settings::Settings;

/// Positions of both bands by their intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlurFit {
    /// Centroids `[u_A, v_A, u_B, v_B]` (px).
    pub features: [f64; 4],
    /// Their covariance (4, 4) (px^2).
    pub covariance: Square<4>,
    /// Brightness of each band in the green channel of [`Patch`](super::patch::Patch) (grey levels).
    pub brightness: [f64; 2],
    /// Share of the variance that the model explains, sensor noise excluded.
    pub explained: f64,
    /// Standard deviation of the residuals (grey levels).
    pub residual: f64,
    /// Standard deviation of the blur kernel (px).
    pub sigma: f64,
    /// Squared Mahalanobis distance of both bands from their predicted positions.
    pub mahalanobis_squared: f64,
    /// The outlines at the positions.
    pub outlines: [Outline; 2],
}

impl BlurFit {
    /// Whether this is the intensity of two bands, at well-determined positions, with enough of each inside the image.
    pub fn is_accepted(&self, map: &RunMap, settings: &Settings) -> bool {
        // Of the count only the pixels in the image matter, which no other outline changes.
        let is_inside =
            |own: &Outline| own.count(map, own).pixels >= settings.least_inside * own.area;
        let limits = &settings.blur;
        let [a, b] = self.brightness;
        let (darker, brighter) = (a.min(b), a.max(b));
        self.explained >= limits.least_explained
            && darker >= limits.least_contrast * self.residual
            && darker >= limits.least_brightness_ratio * brighter
            && self.mahalanobis_squared <= settings.largest_surprise
            && (0..4).all(|index| {
                self.covariance[index][index] <= limits.largest_deviation * limits.largest_deviation
            })
            && self.outlines.iter().all(is_inside)
    }

    /// The result: the explained share takes the place of the edge share, and sigma that of the growth.
    pub fn recognition(&self) -> Recognition {
        let centroids = points(self.features);
        Recognition {
            features: self.features,
            covariance: self.covariance,
            scores: [0, 1].map(|band| BandScore {
                pixels: self.outlines[band].area,
                edges: self.explained,
                growth: self.sigma,
                mahalanobis_squared: self.mahalanobis_squared,
                centroid: centroids[band],
                ..BandScore::default()
            }),
            rejections: [None; 2],
            discriminant: 0,
        }
    }
}
