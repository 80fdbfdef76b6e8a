//! Positions of the bands from which outlines are fitted: pairs of regions that may be the two bands.

use super::outcome::UNKNOWN;
use super::prediction::BandPrediction;
use crate::math::{inverse, quadratic, real_sum};
use crate::scan::{Region, RunMap};

/// Number of pairs that are tried: it bounds the time.
pub const TRIALS: usize = 6;
/// A band that the border cuts is moved at most this often to match the centroid of its visible part.
const SHIFTS: usize = 10;
/// Positions nearer than this to each other lead to the same fit (px): it is within the tolerance of the edges.
pub const SAME: f64 = 0.7;

/// A region for A and one for B; None: it has no region; one region for both: the bands touch.
pub type Pair = [Option<usize>; 2];

/// Regions of the bands, and features (px) of those that have no region of their own.
pub type Candidate = (Pair, [f64; 4]);

/// The likeliest items with their costs, the likeliest first.
pub type Ranking<T, const N: usize> = [Option<(f64, T)>; N];

/// Ranks an item, in place of the one that is the `same` if there is one and it costs more.
pub fn rank<T, const N: usize>(
    ranking: &mut Ranking<T, N>,
    cost: f64,
    item: T,
    same: impl Fn(&T) -> bool,
) {
    let is_after = |one: &Option<(f64, T)>| one.as_ref().is_none_or(|(less, _)| cost < *less);
    if !ranking.last().is_some_and(is_after) {
        return;
    }
    let same = |one: &Option<(f64, T)>| one.as_ref().is_some_and(|(_, other)| same(other));
    let last = ranking.iter().position(same).unwrap_or(N - 1);
    let first = ranking.iter().position(is_after).unwrap_or(N);
    if let Some(after @ [_, ..]) = ranking.get_mut(first..=last) {
        after.rotate_right(1);
        after[0] = Some((cost, item));
    }
}

/// The likeliest pairs of regions.
///
/// The cost of a pair is the squared Mahalanobis distance of its centroids plus the squared logarithms of the ratios of
/// areas. Occlusion moves a centroid with a standard deviation of about a third of the band's radius. A band without a
/// region costs as much as one 4 standard deviations off, 16, and both without one 24; the costs only order the trials.
pub fn likely_pairs(regions: &[Region], prediction: &BandPrediction) -> Ranking<Candidate, TRIALS> {
    let outlines = &prediction.outlines;
    let mut kept = [None; TRIALS];
    let mut covariance = prediction.covariance;
    for (index, row) in covariance.iter_mut().enumerate() {
        row[index] += (0.35 * outlines[index / 2].radius()).powi(2);
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
    let [ua, va, ub, vb] = prediction.features;
    let offset = |index: usize, [u0, v0]: [f64; 2]| {
        let [u, v] = regions[index].centroid();
        [u - u0, v - v0]
    };
    let size = |index: usize, area: f64| (real_sum(regions[index].area) / area).ln().powi(2);
    let alone = |index: usize, band: usize| {
        let offset = offset(index, [[ua, va], [ub, vb]][band]);
        16.0 + quadratic(&single[band], offset) + size(index, outlines[band].area)
    };
    let choices = || (0..regions.len()).map(Some).chain([None]);
    for (a, b) in choices().flat_map(|a| choices().map(move |b| (a, b))) {
        let mut otherwise = UNKNOWN;
        let cost = match (a, b) {
            (Some(a), Some(b)) if a != b => {
                let ([du_a, dv_a], [du_b, dv_b]) = (offset(a, [ua, va]), offset(b, [ub, vb]));
                quadratic(&both, [du_a, dv_a, du_b, dv_b])
                    + size(a, outlines[0].area)
                    + size(b, outlines[1].area)
            }
            (Some(one), Some(_)) => {
                let between = [f64::midpoint(ua, ub), f64::midpoint(va, vb)];
                let [du, dv] = offset(one, between);
                otherwise = [ua + du, va + dv, ub + du, vb + dv];
                quadratic(&middle, [du, dv]) + size(one, outlines[0].area + outlines[1].area)
            }
            (Some(a), None) => alone(a, 0),
            (None, Some(b)) => alone(b, 1),
            (None, None) => 24.0,
        };
        rank(&mut kept, cost, ([a, b], otherwise), |_| false);
    }
    kept
}

/// Centroids of the bands if these regions are the bands.
pub fn centroids(([a, b], [ua, va, ub, vb]): Candidate, regions: &[Region]) -> [f64; 4] {
    let own = |region: Option<usize>| regions.get(region.filter(|_| a != b)?);
    let [ua, va] = own(a).map_or([ua, va], Region::centroid);
    let [ub, vb] = own(b).map_or([ub, vb], Region::centroid);
    [ua, va, ub, vb]
}

/// Centroids of the whole bands from those of their parts inside the image; None if the border cuts neither.
pub fn uncut_centroids(
    mut observed: [f64; 4],
    prior: &BandPrediction,
    map: &RunMap,
) -> Option<[f64; 4]> {
    let mut is_cut = false;
    for (outline, centroid) in prior.outlines.iter().zip(observed.chunks_exact_mut(2)) {
        let part = [centroid[0], centroid[1]];
        let mut outline = outline.moved_to(part);
        for _ in 0..SHIFTS {
            let Some([u, v]) = outline.centroid_within(map) else {
                break;
            };
            let [du, dv] = [part[0] - u, part[1] - v];
            if du.hypot(dv) < SAME {
                break;
            }
            is_cut = true;
            outline = outline.moved([du, dv]);
        }
        centroid.copy_from_slice(&outline.centroid);
    }
    is_cut.then_some(observed)
}
