//! Search for the outlines of both bands among the marker pixels.

use super::fit::{COARSE, FINE, Fit, fit};
use super::outcome::{Recognition, UNKNOWN};
use super::posture_table::{BlobPostures, PostureTable};
use super::prediction::{BandPrediction, BandPredictor};
use super::rejection::Rejection;
use super::starts::{SAME, TRIALS, centroids, likely_pairs, uncut_centroids};
use crate::math::is_near;
use crate::scan::{Frame, Region, RunMap};
use crate::settings::Settings;

/// Outlines are fitted again at most this often, until they move by less than half of the accuracy of 0.2 px.
const REPEATS: usize = 6;
const CONVERGED: f64 = 0.1;
/// Standard deviation of the centroid of a region as a feature (px): part of the band may be hidden.
const REGION_STD: [f64; 4] = [4.0; 4];
/// Least sum of the edge shares of both bands in the coarse fit, without a prediction: it bounds the time.
const PROMISING_EDGES: f64 = 0.5;
/// A band found alone must be nearer to its predicted position than to the other's by this squared Mahalanobis distance:
/// 3 standard deviations.
const AMBIGUITY: f64 = 9.0;

/// Search for both bands near their prediction.
pub struct OutlineSearch<'a, F, P> {
    /// The frame.
    pub frame: &'a F,
    /// The marker pixels.
    pub map: &'a RunMap,
    /// The prediction.
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
            let Some((_, first)) = self.fit(observed, REGION_STD, [true; 2], COARSE) else {
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
            let Some(found) = self.refine(first) else {
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
        let (_, first) = self.fit(observed, std, [true; 2], COARSE)?;
        self.refine(first)
    }

    /// Rejects a band found alone if it is not complete enough, or if the same pixels fit the other band as well.
    fn check_single(&self, mut found: Recognition, band: usize, regions: &[Region]) -> Recognition {
        let score = found.scores[band];
        let least = self.settings.least_edges_alone;
        if score.edges < least || score.coverage < 0.75 * least {
            found.rejections[band] = Some(Rejection::MissingEdges(score.edges));
            found.erase_rejected();
            return found;
        }
        let [u, v] = score.centroid;
        let distance = |region: &Region| {
            let [ru, rv] = region.centroid();
            (ru - u).hypot(rv - v)
        };
        let nearest = (0..regions.len())
            .min_by(|a, b| distance(&regions[*a]).total_cmp(&distance(&regions[*b])));
        let mut pair = [None; 2];
        pair[1 - band] = nearest;
        let mut here = UNKNOWN;
        [here[2 - 2 * band], here[3 - 2 * band]] = [u, v];
        let starts = [here, centroids((pair, UNKNOWN), regions)];
        let is_ambiguous = starts.iter().any(|observed| {
            self.recognise_at(*observed, REGION_STD)
                .is_some_and(|other| {
                    other.rejections[1 - band].is_none()
                        && other.scores[1 - band].mahalanobis_squared
                            < score.mahalanobis_squared + AMBIGUITY
                })
        });
        if is_ambiguous {
            found.rejections[band] = Some(Rejection::Ambiguous);
            found.erase_rejected();
        }
        found
    }

    /// Repeats a fit with the outlines of the posture that it implies, until it converges.
    fn refine(&self, mut found: Fit) -> Option<Recognition> {
        let mut last = None;
        for _ in 0..REPEATS {
            let before = found.features;
            let Some((prediction, next)) = self.fit(before, fit_std(&found), [true; 2], FINE)
            else {
                break;
            };
            found = next;
            last = Some(prediction);
            let moved = before.iter().zip(found.features);
            if moved.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < CONVERGED {
                break;
            }
        }
        let prediction = last?;
        let mut result = Recognition::of(&prediction, &found, self.map, self.settings);
        if self.settings.is_unlocated {
            result.require_instrument(
                self.frame,
                &prediction.outlines_at(found.features),
                &self.predictor.section(found.features, [0.5; 4]),
                self.settings,
            );
        }
        let rejections = result.rejections;
        let is_used = rejections.map(|rejection| rejection.is_none());
        if is_used[0] == is_used[1] {
            return Some(result);
        }
        // A rejected band must not influence the position of the other.
        let mut observed = found.features;
        for band in (0..2).filter(|band| !is_used[*band]) {
            observed[2 * band..2 * band + 2].fill(f64::NAN);
        }
        let (prediction, found) = self.fit(observed, fit_std(&found), is_used, FINE)?;
        let mut single = Recognition::of(&prediction, &found, self.map, self.settings);
        for band in (0..2).filter(|band| !is_used[*band]) {
            single.rejections[band] = rejections[band];
            single.scores[band] = result.scores[band];
        }
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
    ) -> Option<(BandPrediction, Fit)> {
        let prediction = self.predictor.predict(observed, std)?;
        let [[ua, va], [ub, vb]] = prediction.outlines.map(|outline| outline.centroid);
        let mut start = [ua, va, ub, vb];
        for (start, observed) in start.iter_mut().zip(observed) {
            if observed.is_finite() {
                *start = observed;
            }
        }
        let settings = &self.settings.fit;
        let found = fit(&prediction, start, is_used, tolerances, self.map, settings)?;
        Some((prediction, found))
    }
}

/// Standard deviations of a fit's features for the next fit: twice its own plus 0.3 px, because the outlines were those of
/// a posture that was not yet right.
fn fit_std(found: &Fit) -> [f64; 4] {
    [0, 1, 2, 3].map(|index: usize| 0.3 + 2.0 * found.covariance[index][index].max(0.0).sqrt())
}
