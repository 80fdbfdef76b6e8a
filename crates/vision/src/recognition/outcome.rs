//! Result of the recognition of both bands.

use super::fit::Fit;
use super::prediction::BandPrediction;
use super::rejection::Rejection;
use super::score::{BandScore, score};
use crate::scan::RunMap;
use crate::settings::Settings;

/// Recognised bands, or why they are not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recognition {
    /// Centroids `[u_A, v_A, u_B, v_B]` (px); NaN for a band that is not recognised.
    pub features: [f64; 4],
    /// Their covariance (4, 4) (px^2); NaN likewise.
    pub covariance: [[f64; 4]; 4],
    /// Scores of both bands; meaningless where no outline was fitted.
    pub scores: [BandScore; 2],
    /// Why a band is not recognised; None if it is.
    pub rejections: [Option<Rejection>; 2],
    /// Which discriminant it is based on: 0 is the first, others are its alternatives.
    pub discriminant: usize,
}

/// Features that are not known.
pub const UNKNOWN: [f64; 4] = [f64::NAN; 4];

impl Recognition {
    pub(crate) fn of(
        prediction: &BandPrediction,
        fit: &Fit,
        map: &RunMap,
        settings: &Settings,
    ) -> Self {
        let (scores, rejections) = score(prediction, fit, map, settings);
        let mut result = Self {
            features: fit.features,
            covariance: inflated(&fit.covariance, fit.edges, settings),
            scores,
            rejections,
            discriminant: 0,
        };
        result.erase_rejected();
        result
    }

    /// Whether no other candidate needs to be tried.
    pub(crate) fn is_clear(&self, settings: &Settings) -> bool {
        let mut bands = self.scores.iter().zip(&self.rejections);
        bands.all(|(score, rejection)| rejection.is_none() && score.is_clear(settings))
    }

    /// Sets the features of rejected bands to NaN.
    pub(crate) fn erase_rejected(&mut self) {
        for band in (0..2).filter(|band| self.rejections[*band].is_some()) {
            for index in [2 * band, 2 * band + 1] {
                self.features[index] = f64::NAN;
                self.covariance[index] = UNKNOWN;
                for row in &mut self.covariance {
                    row[index] = f64::NAN;
                }
            }
        }
    }

    /// No band, both for the same reason.
    pub(crate) fn none(rejection: Rejection) -> Self {
        Self {
            features: UNKNOWN,
            covariance: [UNKNOWN; 4],
            scores: [BandScore {
                centroid: [f64::NAN; 2],
                ..BandScore::default()
            }; 2],
            rejections: [Some(rejection); 2],
            discriminant: 0,
        }
    }

    /// Quality of a candidate, to compare it with others of the same frame; nothing is accepted or rejected by it.
    ///
    /// An accepted band counts 1 plus its edge share, less 0.02 per unit of squared Mahalanobis distance, which is 0.37 at
    /// the default threshold. A rejected band counts a tenth of its edge share: two of them count less than an accepted
    /// one. A band that is outside the image but clear otherwise counts as accepted; else an outline that fits worse, but
    /// lies farther inside, would be preferred.
    pub(crate) fn quality(&self, settings: &Settings) -> f64 {
        let bands = self.scores.iter().zip(&self.rejections);
        let quality = |(score, rejection): (&BandScore, &Option<Rejection>)| {
            let is_located = match rejection {
                None => true,
                Some(Rejection::Outside { .. }) => score.is_clear(settings),
                Some(_) => false,
            };
            if is_located {
                1.0 + score.edges - 0.02 * score.mahalanobis_squared
            } else {
                0.1 * score.edges
            }
        };
        bands.map(quality).sum()
    }
}

/// Inflates a covariance for missing edges: the contour of an occluding object may pass for a part of an outline.
fn inflated(covariance: &[[f64; 4]; 4], edges: [f64; 2], settings: &Settings) -> [[f64; 4]; 4] {
    let excess = settings.fit.missing_edge_variance;
    let factors = edges.map(|share| (1.0 + excess * (1.0 - share)).sqrt());
    std::array::from_fn(|i| {
        std::array::from_fn(|j| covariance[i][j] * factors[i / 2] * factors[j / 2])
    })
}
