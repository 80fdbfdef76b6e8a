//! Search for the outlines of both bands among the marker pixels.

use super::fit::{COARSE, FINE, Fit, fit};
use super::outcome::{Recognition, UNKNOWN};
use super::posture_table::{BlobPostures, PostureTable};
use super::prediction::{BandPrediction, BandPredictor};
use super::rejection::Rejection;
use super::starts::{SAME, TRIALS, centroids, likely_pairs, uncut_centroids};
use super::surroundings::{LEAST_CONTRAST, contrast_between, section_contrast};
use crate::math::is_near;
use crate::scan::{Frame, Region, RunMap};
use crate::settings::Settings;

/// Outlines are fitted again at most this often, until they move by less than half of the accuracy of 0.2 px.
const REPEATS: usize = 6;
const CONVERGED: f64 = 0.1;
/// Standard deviation of the centroid of a region as a feature (px): part of the band may be hidden.
const REGION_STD: [f64; 4] = [4.0; 4];
/// Standard deviation of the positions whose posture the section is drawn in (px).
const SECTION_STD: [f64; 4] = [0.5; 4];
/// Least sum of the edge shares of both bands in the coarse fit, without a prediction: it bounds the time.
const PROMISING_EDGES: f64 = 0.5;
/// A band found alone must be nearer to its predicted position than to the other's by this squared Mahalanobis distance:
/// 3 standard deviations.
const AMBIGUITY: f64 = 9.0;

/// Search for both bands near their prediction.
pub struct OutlineSearch<'a, F, P> {
    pub frame: &'a F,
    /// The marker pixels.
    pub map: &'a RunMap,
    pub predictor: &'a P,
    /// Thresholds and the settings of the fit.
    pub settings: &'a Settings,
    /// Postures that are compared where the prior is not of one posture.
    pub postures: &'a PostureTable,
}

impl<F: Frame, P: BandPredictor> OutlineSearch<'_, F, P> {
    /// Recognises the bands among the regions. Without a prediction, postures of both bands in one region are added to `blobs`.
    pub fn recognise(&self, regions: &[Region], blobs: &mut BlobPostures) -> Recognition {
        let Some(prior) = self.predictor.predict(UNKNOWN, [f64::INFINITY; 4]) else {
            return Recognition::none(Rejection::NotPredicted);
        };
        if regions.is_empty() {
            return Recognition::none(Rejection::NoRegion);
        }
        let mut best: Option<Recognition> = None;
        let mut tried = [UNKNOWN; 2 * TRIALS];
        let starts = self.starts(regions, &prior, blobs).into_iter();
        for (index, observed) in starts.flatten().enumerate() {
            let Some(first) = self.fit(observed, REGION_STD, [true; 2], COARSE) else {
                continue;
            };
            // Many pairs lead to the same fit.
            let is_same = |before: &[f64; 4]| is_near(before, &first.features, SAME);
            if tried.iter().any(is_same) {
                continue;
            }
            tried[index] = first.features;
            if !self.predictor.is_located() && first.edges[0] + first.edges[1] < PROMISING_EDGES {
                continue;
            }
            let Some(found) = self.refine(&first) else {
                continue;
            };
            if best.is_none_or(|other| found.is_better(&other, self.settings)) {
                best = Some(found);
            }
            if found.is_certain(self.settings) {
                break;
            }
        }
        let Some(found) = best else {
            return Recognition::none(Rejection::NoRegion);
        };
        match found.rejections {
            [None, Some(_)] => self.check_single(found, 0, regions),
            [Some(_), None] => self.check_single(found, 1, regions),
            _ => found,
        }
    }

    /// Centroids of the bands (px) from which outlines are fitted, the likeliest first.
    fn starts(
        &self,
        regions: &[Region],
        prior: &BandPrediction,
        blobs: &mut BlobPostures,
    ) -> [Option<[f64; 4]>; 2 * TRIALS] {
        let is_from_prior = self.predictor.is_located() || self.postures.is_empty();
        let candidates = if is_from_prior {
            likely_pairs(regions, prior)
        } else {
            self.postures.likely_pairs(regions, blobs)
        };
        let mut starts = [None; 2 * TRIALS];
        for (places, (_, candidate)) in starts
            .chunks_exact_mut(2)
            .zip(candidates.into_iter().flatten())
        {
            let observed = centroids(candidate, regions);
            let uncut = if is_from_prior {
                uncut_centroids(observed, prior, self.map)
            } else {
                let near = self.predictor.predict(observed, REGION_STD);
                near.and_then(|near| uncut_centroids(observed, &near, self.map))
            };
            places.copy_from_slice(&[Some(observed), uncut]);
        }
        starts
    }

    /// Recognises the bands near features `observed` (4,) (px) with standard deviations `std` (4,) (px).
    pub fn recognise_at(&self, observed: [f64; 4], std: [f64; 4]) -> Option<Recognition> {
        self.refine(&self.fit(observed, std, [true; 2], COARSE)?)
    }

    /// Rejects a band found alone if the posture is not known, it is not complete enough, or the same pixels fit the other as well.
    fn check_single(&self, mut found: Recognition, band: usize, regions: &[Region]) -> Recognition {
        let (score, other) = (found.scores[band], 1 - band);
        let least = self.settings.least_edges_alone;
        let [u, v] = score.centroid;
        let distance = |[ru, rv]: &[f64; 2]| (ru - u).hypot(rv - v);
        let centroids = regions.iter().map(Region::centroid);
        let nearest = centroids.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let fits_other = |place: [f64; 2]| {
            let mut observed = UNKNOWN;
            observed[2 * other..2 * other + 2].copy_from_slice(&place);
            let found = self.recognise_at(observed, REGION_STD);
            found.is_some_and(|found| {
                found.rejections[other].is_none()
                    && found.scores[other].mahalanobis_squared
                        < score.mahalanobis_squared + AMBIGUITY
            })
        };
        if self.settings.is_unlocated {
            found.rejections[band] = Some(Rejection::Alone);
        } else if score.edges < least || score.coverage < 0.75 * least {
            found.rejections[band] = Some(Rejection::MissingEdges(score.edges));
        } else if fits_other([u, v]) || nearest.is_some_and(fits_other) {
            found.rejections[band] = Some(Rejection::Ambiguous);
        }
        found.erase_rejected();
        found
    }

    /// Whether the image shows an instrument between the bands and next to them; where it does not tell, whether the bands are
    /// certain.
    fn has_instrument(&self, fit: &Fit, bands: &Recognition) -> bool {
        let between = contrast_between(self.frame, &fit.outlines);
        match [between, self.section_contrast(fit.features)] {
            [None, None] => bands.is_certain(self.settings),
            parts => (parts.into_iter().flatten()).all(|contrast| contrast > LEAST_CONTRAST),
        }
    }

    /// See [`section_contrast`], in the posture at these features (px).
    pub fn section_contrast(&self, features: [f64; 4]) -> Option<f64> {
        let section = self.predictor.section(features, SECTION_STD);
        section_contrast(self.frame, &section)
    }

    /// Repeats a fit with the outlines of the posture that it implies, until it converges.
    fn refine(&self, first: &Fit) -> Option<Recognition> {
        let again = |fit: &Fit| self.fit(fit.features, fit_std(fit), [true; 2], FINE);
        let (mut before, mut found) = (first.features, again(first)?);
        for _ in 1..REPEATS {
            if is_near(&before, &found.features, CONVERGED) {
                break;
            }
            let Some(next) = again(&found) else { break };
            (before, found) = (found.features, next);
        }
        let mut result = Recognition::of(&found, self.map, self.settings);
        if self.settings.is_unlocated
            && result.rejections == [None; 2]
            && !self.has_instrument(&found, &result)
        {
            result.rejections = [Some(Rejection::NoInstrument); 2];
            result.erase_rejected();
        }
        let is_used = result.rejections.map(|rejection| rejection.is_none());
        if is_used[0] == is_used[1] {
            return Some(result);
        }
        // A rejected band, whose features are NaN, must not influence the position of the other.
        let alone = self.fit(result.features, fit_std(&found), is_used, FINE)?;
        let mut single = Recognition::of(&alone, self.map, self.settings);
        let rejected = usize::from(is_used[0]);
        single.rejections[rejected] = result.rejections[rejected];
        single.scores[rejected] = result.scores[rejected];
        single.erase_rejected();
        Some(single)
    }

    /// Fits the outlines of the posture that explains the features `observed`, starting there.
    fn fit(
        &self,
        observed: [f64; 4],
        std: [f64; 4],
        is_used: [bool; 2],
        tolerances: [f64; 3],
    ) -> Option<Fit> {
        let prediction = self.predictor.predict(observed, std)?;
        let start = std::array::from_fn(|index| match observed[index] {
            known if known.is_finite() => known,
            _ => prediction.outlines[index / 2].centroid[index % 2],
        });
        let settings = &self.settings.fit;
        fit(&prediction, start, is_used, tolerances, self.map, settings)
    }
}

/// Standard deviations of a fit's features for the next fit: twice its own plus 0.3 px, because the outlines were those of
/// a posture that was not yet right.
fn fit_std(found: &Fit) -> [f64; 4] {
    [0, 1, 2, 3].map(|index: usize| 0.3 + 2.0 * found.covariance[index][index].max(0.0).sqrt())
}
