//! Gain of one DOF: travel of the tip over that of the command in contact.

/// Bounds of the gain.
const LEAST: f64 = 0.5;
const LARGEST: f64 = 1.5;

/// Linear regression of the measured tip on the output of plays that no image corrects.
///
/// ```text
/// gain = (cov(x, y) + prior) / (var(x) + prior)
/// ```
///
/// with sums over the travel, forgotten over `window`, of x, the output, and y, the tip, about the position at the start;
/// both in units of the DOF. Within a stroke a gain below 1 and a wider slack look alike. Over the whole range they do not,
/// because the error of the output is bounded by the slack; while the range is small, `prior` keeps the gain at 1.
///
/// Wrong while motion stays within a few slack widths, by the prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GainEstimate {
    weight: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl GainEstimate {
    /// Nothing measured: gain 1.
    pub const fn new() -> Self {
        Self {
            weight: 0.0,
            x: 0.0,
            y: 0.0,
            xx: 0.0,
            xy: 0.0,
        }
    }

    /// Update with output and tip after a travel of the reference.
    pub fn update(&mut self, output: f64, tip: f64, travel: f64, window: f64) {
        let keep = libm::exp(-travel / window);
        let new = [1.0, output, tip, output * output, output * tip];
        let sums = [
            &mut self.weight,
            &mut self.x,
            &mut self.y,
            &mut self.xx,
            &mut self.xy,
        ];
        for (sum, new) in sums.into_iter().zip(new) {
            *sum = keep * *sum + travel * new;
        }
    }

    /// The gain, with the strength of the prior.
    pub fn value(&self, prior: f64) -> f64 {
        if self.weight == 0.0 {
            return 1.0;
        }
        let variance = self.xx - self.x * self.x / self.weight;
        let covariance = self.xy - self.x * self.y / self.weight;
        ((covariance + prior) / (variance + prior)).clamp(LEAST, LARGEST)
    }
}
