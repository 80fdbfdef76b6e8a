//! The samples of a patch against two bands' light: the equations they make, and what they leave.

use crate::layer::Layer;
use crate::linear::Square;
use crate::patch::Patch;

/// Places, light of A and B, ground, spread, and how the tissue's colour changes.
pub const UNKNOWNS: usize = 12;
/// Least deviation of the tissue's colour relative to its redness.
const LEAST_MOTLEY: f64 = 0.015;

/// See [`left`].
pub struct Left {
    /// Share of the variance that is explained, but for the sensor's noise.
    pub explained: f64,
    /// Standard deviation of what is not (grey levels).
    pub noise: f64,
    /// See [`Errors::motley`].
    pub motley: f64,
}

/// How far a sample may be from the model.
pub struct Errors {
    /// Variance of the sensor's noise (grey levels squared).
    pub grain: f64,
    /// Samples that err alike.
    pub alike: f64,
    /// Deviation of a band's light (grey levels).
    pub uneven: f64,
    /// Deviation of the tissue's colour, relative to its redness.
    pub motley: f64,
}

impl Errors {
    /// One over the variance of a sample so red.
    fn weight(&self, redness: f64) -> f64 {
        let own = self.uneven.powi(2) + (self.motley * redness).powi(2);
        1.0 / (self.grain + self.alike * own).max(1.0)
    }
}

/// The normal equations: `normal x = right`.
pub struct Sums {
    pub normal: Square<UNKNOWNS>,
    pub right: [f64; UNKNOWNS],
}

/// The normal equations over all samples: steps of the four places, light of A and B, ground, step of the spread.
pub fn sums(
    patch: &Patch,
    layers: &[Layer; 2],
    light: [f64; 2],
    spread: f64,
    errors: &Errors,
) -> Sums {
    let columns = patch.columns;
    let rows = patch.green.len() / columns.max(1);
    let step = patch.step;
    let mut sums = Sums {
        normal: [[0.0; UNKNOWNS]; UNKNOWNS],
        right: [0.0; UNKNOWNS],
    };
    for v in 1..rows.saturating_sub(1) {
        for u in 1..columns.saturating_sub(1) {
            let at = v * columns + u;
            let mut row = [0.0; UNKNOWNS];
            row[6] = 1.0;
            row[8..].copy_from_slice(&patch.tissue(at));
            for (band, layer) in layers.iter().enumerate() {
                let [here, left, right, above, below] =
                    [at, at - 1, at + 1, at - columns, at + columns].map(|index| {
                        f64::from(layer.share.get(index).copied().unwrap_or_default())
                    });
                row[2 * band] = -light[band] * (right - left) / (2.0 * step);
                row[2 * band + 1] = -light[band] * (below - above) / (2.0 * step);
                row[4 + band] = here;
                row[7] += light[band] * spread * (left + right + above + below - 4.0 * here)
                    / (step * step);
            }
            let green = f64::from(patch.green.get(at).copied().unwrap_or_default());
            let weight = errors.weight(patch.redness(at));
            for (index, own) in row.iter().enumerate() {
                let weighted = weight * own;
                sums.right[index] += weighted * green;
                let below = sums.normal[index].iter_mut().zip(row).take(index + 1);
                for (entry, other) in below {
                    *entry += weighted * other;
                }
            }
        }
    }
    for i in 0..UNKNOWNS {
        for j in 0..i {
            sums.normal[j][i] = sums.normal[i][j];
        }
    }
    sums
}

/// What is left of the light when the bands are taken out.
pub fn left(
    patch: &Patch,
    layers: &[Layer; 2],
    found: &[f64; UNKNOWNS],
    light: [f64; 2],
    grain: f64,
) -> Left {
    let (mut count, mut sum, mut square, mut left) = (0.0, 0.0, 0.0, 0.0);
    let (mut hue, mut fourth) = (0.0, 0.0);
    let [a, b] = layers;
    for (at, ((green, a), b)) in patch.green.iter().zip(&a.share).zip(&b.share).enumerate() {
        let tissue = patch.tissue(at);
        let tissue: f64 = tissue
            .iter()
            .zip(&found[8..])
            .map(|(value, by)| value * by)
            .sum();
        let green = f64::from(*green) - tissue - found[6];
        let model = light[0] * f64::from(*a) + light[1] * f64::from(*b);
        let red = patch.redness(at).powi(2);
        let missed = (green - model).powi(2);
        count += 1.0;
        sum += green;
        square += green * green;
        left += missed;
        hue += (missed - grain) * red;
        fourth += red * red;
    }
    let variance = square - sum * sum / f64::max(count, 1.0) - count * grain;
    Left {
        explained: 1.0 - f64::max(left - count * grain, 0.0) / f64::max(variance, 1.0),
        noise: (left / f64::max(count, 1.0)).sqrt(),
        motley: (hue / f64::max(fourth, 1.0))
            .max(0.0)
            .sqrt()
            .max(LEAST_MOTLEY),
    }
}
