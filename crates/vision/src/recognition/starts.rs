//! Positions of the bands from which outlines are fitted.

use super::outcome::UNKNOWN;
use super::pairing::Pair;
use super::prediction::BandPrediction;
use crate::scan::{Region, RunMap};

/// A band that the border cuts is moved at most this often to match the centroid of its visible part.
const SHIFTS: usize = 10;
/// Positions nearer than this to each other lead to the same fit (px): it is within the tolerance of the edges.
pub const SAME: f64 = 0.7;

/// Centroids of the bands if these regions are the bands.
pub fn centroids(pair: Pair, prior: &BandPrediction, regions: &[Region]) -> [f64; 4] {
    let mut observed = UNKNOWN;
    for (band, region) in pair.into_iter().enumerate() {
        if let Some(region) = region.and_then(|index| regions.get(index)) {
            [observed[2 * band], observed[2 * band + 1]] = region.centroid();
        }
    }
    if let [Some(one), Some(other)] = pair
        && one == other
    {
        let [u, v] = prior.shift_to(regions[one].centroid());
        let [ua, va, ub, vb] = prior.features;
        observed = [ua + u, va + v, ub + u, vb + v];
    }
    observed
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
