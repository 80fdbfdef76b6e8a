//! Robust fit of both outlines to the edges of the marker pixels.

use super::contour::{Contour, find_edge};
use super::outline::Outline;
use super::prediction::BandPrediction;
use crate::math::{Square, apply, difference, inverse, quadratic};
use crate::scan::RunMap;
use crate::settings::FitSettings;

/// Fewer samples of a rim than this do not tell what share of it is visible.
const LEAST_RIM_SAMPLES: f64 = 8.0;
/// Edge tolerance, relative to the one of the settings, by iteration: from the centroid of a region.
pub const COARSE: [f64; 3] = [4.0, 2.0, 1.4];
/// And from an earlier fit.
pub const FINE: [f64; 3] = [1.4, 1.0, 1.0];

/// Fitted outlines of both bands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Centroids `[u_A, v_A, u_B, v_B]` (px).
    pub features: [f64; 4],
    /// Their covariance (4, 4) (px^2).
    pub covariance: Square<4>,
    /// The predicted outlines at the centroids, without growth.
    pub outlines: [Outline; 2],
    /// Growth of the outlines by blur and threshold (px): of the rims of A, its sides, those of B. The rims, beyond which
    /// there is the tip, and the sides, beyond which there is tissue, move differently.
    pub growth: [f64; 4],
    /// Share of each outline in the image at which an edge was found within the tolerance.
    pub edges: [f64; 2],
    /// The same for the rims alone; 1 if less than a few samples of them are in the image.
    pub rims: [f64; 2],
    /// Squared Mahalanobis distance from the predicted features, 4 degrees of freedom.
    pub mahalanobis_squared: f64,
}

/// Fits the predicted outlines to the edges of the marker pixels, from centroids `start` on.
///
/// Robust least squares for both positions d and the growth b of each outline: with n the outward normal, r the
/// distance of the edge and s its standard deviation,
///
/// ```text
/// sum_k w(r_k - n_k d - b) (r_k - n_k d - b)^2 / s^2 + (d - d0)' P^-1 (d - d0) + b^2 / B^2
/// ```
///
/// w is Tukey's weight, whose width decreases with each iteration (`tolerances`), so that occluding objects do not pull
/// at an outline. The covariance P of the prediction ties the two bands together; both are also blurred alike, which
/// tells position from growth where only one rim of a band is inside the image. `is_used` selects the bands whose edges
/// are used. None if a covariance is singular.
pub fn fit(
    prediction: &BandPrediction,
    start: [f64; 4],
    is_used: [bool; 2],
    tolerances: [f64; 3],
    map: &RunMap,
    settings: &FitSettings,
) -> Option<Fit> {
    let prior = inverse(prediction.covariance)?;
    let [a, b] = &prediction.outlines;
    let contours = [a, b].map(|outline| Contour::of(outline, settings.edge_reach));
    let size = f64::midpoint(a.radius(), b.radius());
    let common = (settings.growth_deviation + settings.growth_share * size).powi(-2);
    let apart = (settings.growth_difference + settings.growth_difference_share * size).powi(-2);
    let mut position = start;
    let mut growth = [0.0_f64; 4];
    let mut result = None;
    for width in tolerances {
        let mut normal = [[0.0; 8]; 8];
        let mut right = [0.0; 8];
        let away = difference(prediction.features, position);
        for (row, pull) in apply(&prior, away).into_iter().enumerate() {
            right[row] = pull;
            normal[row][..4].copy_from_slice(&prior[row]);
        }
        for (index, row) in normal.iter_mut().enumerate().skip(4) {
            let other = if index < 6 { index + 2 } else { index - 2 };
            row[index] = common + apart;
            row[other] = -apart;
        }
        // By part: rims and sides of A, rims and sides of B.
        let (mut edges, mut visible) = ([0.0; 4], [0.0; 4]);
        for (band, contour) in contours.iter().enumerate() {
            if !is_used[band] {
                continue;
            }
            let [u, v] = [position[2 * band], position[2 * band + 1]];
            for sample in contour.samples() {
                let part = 2 * band + usize::from(sample.is_side);
                let tolerance = settings.edge_tolerance * width;
                let reach = (tolerance + growth[part].abs()).min(contour.reach);
                let at = [u + sample.offset[0], v + sample.offset[1]];
                let Some(offset) = find_edge(map, at, sample.normal, reach) else {
                    continue;
                };
                visible[part] += 1.0;
                let share = (offset - growth[part]) / tolerance;
                if share.abs() >= 1.0 {
                    continue;
                }
                edges[part] += 1.0;
                let weight = (1.0 - share * share).powi(2)
                    / (settings.edge_deviation * settings.edge_deviation);
                let [nu, nv] = sample.normal;
                let row = [(2 * band, nu), (2 * band + 1, nv), (4 + part, 1.0)];
                for (i, own) in row {
                    right[i] += weight * own * offset;
                    for (j, other) in row {
                        normal[i][j] += weight * own * other;
                    }
                }
            }
        }
        let covariance = inverse(normal)?;
        let [du_a, dv_a, du_b, dv_b, rims_a, sides_a, rims_b, sides_b] = apply(&covariance, right);
        growth = [rims_a, sides_a, rims_b, sides_b];
        for (value, step) in position.iter_mut().zip([du_a, dv_a, du_b, dv_b]) {
            *value += step;
        }
        result = Some(Fit {
            features: position,
            outlines: prediction.outlines_at(position),
            covariance: [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| covariance[i][j])),
            growth,
            edges: [0, 2].map(|part| {
                (edges[part] + edges[part + 1]) / f64::max(visible[part] + visible[part + 1], 1.0)
            }),
            rims: [0, 2].map(|part| match visible[part] {
                count if count < LEAST_RIM_SAMPLES => 1.0,
                count => edges[part] / count,
            }),
            mahalanobis_squared: quadratic(&prior, difference(prediction.features, position)),
        });
    }
    result
}
