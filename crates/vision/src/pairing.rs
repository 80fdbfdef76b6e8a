//! Which regions may be which bands.

use crate::linear::{inverse, quadratic};
use crate::regions::real;
use crate::{Expectation, Region};

/// Pairs of regions that are tried, the likeliest first.
pub const TRIALS: usize = 6;

/// A region for A and one for B; none: not among the regions; one for both: they run into each other.
pub type Pair = [Option<usize>; 2];

/// The likeliest pairs, the likeliest first: squared Mahalanobis distance of each pair's centroids, where a
/// centroid may be off by a third of the band's size, and squared logarithm of the ratios of areas. A band without a region
/// costs as much as one four deviations off.
pub fn likely(regions: &[Region], expected: &Expectation) -> [Option<Pair>; TRIALS] {
    let mut kept: [Option<(f64, Pair)>; TRIALS] = [None; TRIALS];
    let slack = expected
        .bands
        .each_ref()
        .map(|band| (0.35 * band.radius()).powi(2));
    let mut covariance = expected.covariance;
    for (index, row) in covariance.iter_mut().enumerate() {
        row[index] += slack[index / 2];
    }
    let choices = || (0..regions.len()).map(Some).chain([None]);
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
    let away = |index: usize, band: usize| {
        let [u, v] = regions[index].centroid();
        [
            u - expected.features[2 * band],
            v - expected.features[2 * band + 1],
        ]
    };
    let size = |index: usize, band: usize| {
        (real(regions[index].area) / expected.bands[band].area)
            .ln()
            .powi(2)
    };
    for a in choices() {
        for b in choices() {
            let cost = match (a, b) {
                (Some(a), Some(b)) if a != b => {
                    let ([ua, va], [ub, vb]) = (away(a, 0), away(b, 1));
                    quadratic(&both, [ua, va, ub, vb]) + size(a, 0) + size(b, 1)
                }
                (Some(a), None) => 16.0 + quadratic(&single[0], away(a, 0)) + size(a, 0),
                (None, Some(b)) => 16.0 + quadratic(&single[1], away(b, 1)) + size(b, 1),
                (Some(one), Some(_)) => {
                    let both = expected.bands[0].area + expected.bands[1].area;
                    let shift = shift(regions[one].centroid(), expected);
                    quadratic(&middle, shift) + (real(regions[one].area) / both).ln().powi(2)
                }
                (None, None) => 24.0,
            };
            let place = kept
                .iter()
                .position(|one| one.is_none_or(|(less, _)| cost < less));
            if let Some(place) = place {
                kept[place..].rotate_right(1);
                kept[place] = Some((cost, [a, b]));
            }
        }
    }
    kept.map(|one| one.map(|(_, pair)| pair))
}

/// From the middle of the two expected bands to a region over both.
pub fn shift([u, v]: [f64; 2], expected: &Expectation) -> [f64; 2] {
    let [ua, va, ub, vb] = expected.features;
    [u - f64::midpoint(ua, ub), v - f64::midpoint(va, vb)]
}
