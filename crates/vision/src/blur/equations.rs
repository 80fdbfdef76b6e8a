//! Normal equations of the intensity fit, and its residuals.

use super::mask::Mask;
use super::patch::Patch;
use crate::math::Square;

/// Unknowns: steps of the four coordinates, brightness of A and B, background, step of sigma, and four of the change in
/// the tissue's colour.
pub const UNKNOWNS: usize = 12;
/// Step of the numerical derivatives (px).
pub const DIFFERENCE: f64 = 0.5;
/// Index of the background.
pub const BACKGROUND: usize = 6;
/// Index of the step of sigma.
pub const SIGMA: usize = 7;

/// Residuals of the intensity fit.
pub struct Residuals {
    /// Share of the variance that is explained, sensor noise excluded.
    pub explained: f64,
    /// Standard deviation (grey levels).
    pub std: f64,
    /// Standard deviation of the tissue's colour that they imply, relative to its redness.
    pub tissue_unevenness: f64,
}

/// The matrix and the right-hand side of the normal equations over all samples but those at the border of the patch;
/// `moved` are the masks where each coordinate is larger by [`DIFFERENCE`], `weight` is the inverse variance of a sample by its
/// redness (grey levels).
pub fn normal_equations(
    patch: &Patch,
    [moved @ .., masks]: &[[Mask; 2]; 5],
    brightness: [f64; 2],
    sigma: f64,
    weight: impl Fn(f64) -> f64,
) -> (Square<UNKNOWNS>, [f64; UNKNOWNS]) {
    let columns = patch.columns;
    let rows = patch.green.len() / columns.max(1);
    let step = patch.step;
    let value =
        |samples: &[f32], at: usize| f64::from(samples.get(at).copied().unwrap_or_default());
    let mut normal = [[0.0; UNKNOWNS]; UNKNOWNS];
    let mut right_side = [0.0; UNKNOWNS];
    for v in 1..rows.saturating_sub(1) {
        for u in 1..columns.saturating_sub(1) {
            let at = v * columns + u;
            let mut row = [0.0; UNKNOWNS];
            row[BACKGROUND] = 1.0;
            row[SIGMA + 1..].copy_from_slice(&patch.tissue(at));
            for (band, mask) in masks.iter().enumerate() {
                let [here, left, right, above, below] =
                    [at, at - 1, at + 1, at - columns, at + columns]
                        .map(|at| value(&mask.coverage, at));
                for (entry, masks) in row.iter_mut().zip(moved) {
                    let there = value(&masks[band].coverage, at);
                    *entry += brightness[band] * (there - here) / DIFFERENCE;
                }
                row[4 + band] = here;
                // A Gaussian's derivative by sigma is sigma times its Laplacian.
                row[SIGMA] +=
                    brightness[band] * sigma * (left + right + above + below - 4.0 * here)
                        / (step * step);
            }
            let green = value(&patch.green, at);
            let weight = weight(patch.redness(at));
            for (index, own) in row.iter().enumerate() {
                let weighted = weight * own;
                right_side[index] += weighted * green;
                let lower = normal[index].iter_mut().zip(row).take(index + 1);
                for (entry, other) in lower {
                    *entry += weighted * other;
                }
            }
        }
    }
    for i in 0..UNKNOWNS {
        let (upper, lower) = normal.split_at_mut(i);
        for (above, value) in upper.iter_mut().zip(lower[0]) {
            above[i] = value;
        }
    }
    (normal, right_side)
}

/// The residuals of a solution, with the brightness within its bounds.
pub fn residuals(
    patch: &Patch,
    [a, b]: &[Mask; 2],
    solution: &[f64; UNKNOWNS],
    brightness: [f64; 2],
    sensor_variance: f64,
) -> Residuals {
    let (mut count, mut sum, mut square, mut left) = (0.0, 0.0, 0.0, 0.0);
    let (mut tissue_square, mut fourth) = (0.0, 0.0);
    let samples = patch.green.iter().zip(&a.coverage).zip(&b.coverage);
    for (at, ((green, a), b)) in samples.enumerate() {
        let tissue = patch.tissue(at).into_iter().zip(&solution[SIGMA + 1..]);
        let tissue: f64 = tissue.map(|(value, by)| value * by).sum();
        let green = f64::from(*green) - tissue - solution[BACKGROUND];
        let model = brightness[0] * f64::from(*a) + brightness[1] * f64::from(*b);
        let red = patch.redness(at).powi(2);
        let residual = (green - model).powi(2);
        count += 1.0;
        sum += green;
        square += green * green;
        left += residual;
        tissue_square += (residual - sensor_variance) * red;
        fourth += red * red;
    }
    let variance = square - sum * sum / f64::max(count, 1.0) - count * sensor_variance;
    Residuals {
        explained: 1.0 - f64::max(left - count * sensor_variance, 0.0) / f64::max(variance, 1.0),
        std: (left / f64::max(count, 1.0)).sqrt(),
        tissue_unevenness: (tissue_square / f64::max(fourth, 1.0)).max(0.0).sqrt(),
    }
}
