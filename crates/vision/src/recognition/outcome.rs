//! Result of the recognition of both bands.

use super::fit::Fit;
use super::rejection::Rejection;
use super::score::{BandScore, score};
use crate::math::is_near;
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

/// Quality per unit of the logarithm of the explained marker pixels, to compare candidates in different places.
const AREA_QUALITY: f64 = 0.5;
/// Candidates nearer than this to each other are in the same place (px).
const SAME_PLACE: f64 = 2.0;
/// Features that are not known.
pub const UNKNOWN: [f64; 4] = [f64::NAN; 4];

impl Recognition {
    pub(crate) fn of(fit: &Fit, map: &RunMap, settings: &Settings) -> Self {
        let (scores, rejections) = score(fit, map, settings);
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

    /// Centroids of the outlines that were found last `[u_A, v_A, u_B, v_B]` (px), rejected ones included.
    pub(crate) fn centroids(&self) -> [f64; 4] {
        let [[ua, va], [ub, vb]] = self.scores.map(|score| score.centroid);
        [ua, va, ub, vb]
    }

    /// Whether no other candidate needs to be tried.
    pub(crate) fn is_clear(&self, settings: &Settings) -> bool {
        let mut bands = self.scores.iter().zip(&self.rejections);
        bands.all(|(score, rejection)| rejection.is_none() && score.is_clear(settings))
    }

    /// Whether it is so clear that no other candidate in the frame can be better.
    pub(crate) fn is_certain(&self, settings: &Settings) -> bool {
        let least = settings.unlocated.certain_edges;
        let has_edges = self.scores.iter().all(|score| score.edges >= least);
        self.is_clear(settings) && (has_edges || !settings.is_unlocated)
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

    /// Quality of a candidate, by which [`is_better`](Self::is_better) compares it; nothing is accepted or rejected by it.
    ///
    /// An accepted band counts 1 plus its edge share, less 0.02 per unit of squared Mahalanobis distance, which is 0.37 at
    /// the default threshold. A rejected band counts a tenth of its edge share: two of them count less than an accepted
    /// one. A band that is outside the image but clear otherwise counts as accepted; else an outline that fits worse, but
    /// lies farther inside, would be preferred.
    fn quality(&self, settings: &Settings) -> f64 {
        let bands = self.scores.iter().zip(&self.rejections);
        let quality = |(score, rejection): (&BandScore, &Option<Rejection>)| {
            if is_located(score, *rejection, settings) {
                1.0 + score.edges - 0.02 * score.mahalanobis_squared
            } else {
                0.1 * score.edges
            }
        };
        bands.map(quality).sum()
    }

    /// Whether this candidate is better than another one of the same frame.
    ///
    /// Where the other is clear and in the same place, the first that was found is kept. Elsewhere the logarithm of the
    /// number of explained marker pixels counts too: parts of one band may look like two small ones.
    pub(crate) fn is_better(&self, other: &Self, settings: &Settings) -> bool {
        if is_near(&self.features, &other.features, SAME_PLACE) {
            return !other.is_clear(settings) && self.quality(settings) > other.quality(settings);
        }
        let quality = |one: &Self| {
            let bands = one.scores.iter().zip(&one.rejections);
            let pixels: f64 = bands
                .filter(|(score, rejection)| is_located(score, **rejection, settings))
                .map(|(score, _)| score.pixels)
                .sum();
            one.quality(settings) + AREA_QUALITY * f64::max(pixels, 1.0).ln()
        };
        quality(self) > quality(other)
    }
}

/// Whether the place of a band is known, even if it is outside the image.
fn is_located(score: &BandScore, rejection: Option<Rejection>, settings: &Settings) -> bool {
    match rejection {
        None => true,
        Some(Rejection::Outside(_)) => score.is_clear(settings),
        Some(_) => false,
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
