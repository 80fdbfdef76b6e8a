//! Pairs of regions that may be the two bands.

use super::prediction::BandPrediction;
use crate::math::{inverse, quadratic, real_sum};
use crate::scan::Region;

/// Number of pairs that are tried: it bounds the time.
pub const TRIALS: usize = 6;

/// A region for A and one for B; None: it has no region; one region for both: the bands touch.
pub type Pair = [Option<usize>; 2];

/// The likeliest pairs, the likeliest first.
///
/// The cost of a pair is the squared Mahalanobis distance of its centroids plus the squared logarithms of the ratios of
/// areas. Occlusion moves a centroid with a standard deviation of about a third of the band's radius. A band without a
/// region costs as much as one 4 standard deviations off, 16, and both without one 24; the costs only order the trials.
pub fn likely_pairs(regions: &[Region], prediction: &BandPrediction) -> [Option<Pair>; TRIALS] {
    let outlines = &prediction.outlines;
    let mut kept: [Option<(f64, Pair)>; TRIALS] = [None; TRIALS];
    let variance = outlines
        .each_ref()
        .map(|outline| (0.35 * outline.radius()).powi(2));
    let mut covariance = prediction.covariance;
    for (index, row) in covariance.iter_mut().enumerate() {
        row[index] += variance[index / 2];
    }
    let both = inverse(covariance).unwrap_or([[0.0; 4]; 4]);
    let single = [0, 2].map(|at| {
        let part = [0, 1].map(|i| [0, 1].map(|j| covariance[at + i][at + j]));
        inverse(part).unwrap_or([[0.0; 2]; 2])
    });
    let middle = [0, 1].map(|i| {
        [0, 1].map(|j| {
            let across = covariance[i][j + 2] + covariance[i + 2][j];
            (covariance[i][j] + covariance[i + 2][j + 2] + across) / 4.0
        })
    });
    let middle = inverse(middle).unwrap_or([[0.0; 2]; 2]);
    let offset = |index: usize, band: usize| {
        let [u, v] = regions[index].centroid();
        let [u0, v0] = [0, 1].map(|axis| prediction.features[2 * band + axis]);
        [u - u0, v - v0]
    };
    let size = |index: usize, area: f64| (real_sum(regions[index].area) / area).ln().powi(2);
    let choices = || (0..regions.len()).map(Some).chain([None]);
    for (a, b) in choices().flat_map(|a| choices().map(move |b| (a, b))) {
        let cost = match (a, b) {
            (Some(a), Some(b)) if a != b => {
                let ([ua, va], [ub, vb]) = (offset(a, 0), offset(b, 1));
                quadratic(&both, [ua, va, ub, vb])
                    + size(a, outlines[0].area)
                    + size(b, outlines[1].area)
            }
            (Some(a), None) => {
                16.0 + quadratic(&single[0], offset(a, 0)) + size(a, outlines[0].area)
            }
            (None, Some(b)) => {
                16.0 + quadratic(&single[1], offset(b, 1)) + size(b, outlines[1].area)
            }
            (Some(one), Some(_)) => {
                let shift = prediction.shift_to(regions[one].centroid());
                quadratic(&middle, shift) + size(one, outlines[0].area + outlines[1].area)
            }
            (None, None) => 24.0,
        };
        let rank = kept
            .iter()
            .position(|one| one.is_none_or(|(less, _)| cost < less));
        if let Some(rank) = rank {
            kept[rank..].rotate_right(1);
            kept[rank] = Some((cost, [a, b]));
        }
    }
    kept.map(|one| one.map(|(_, pair)| pair))
}
