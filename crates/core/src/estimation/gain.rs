//! Gain of one DOF: travel of the tip over that of the command in contact.

use crate::math::linear::square;

/// Bounds of the gain.
const LEAST: f64 = 0.5;
const LARGEST: f64 = 1.5;
/// Longest travel that one image stands for: after motion without an image the next one may be wrong.
const LONGEST: f64 = 0.25;

/// Linear regression of the measured tip on output and deflection of plays that no image corrects.
///
/// ```text
/// y = gain x + b d + constant
/// ```
///
/// by least squares, weighted by the travel of x of at most 0.25, forgotten over `window`; x is the output, d = command - x the deflection,
/// and y the tip, about the position at the start, in units of the DOF. `prior` is what the squares of gain - 1 and b cost. A
/// half width that is wrong moves the two sides of the loop apart, by a share of the deflection: b takes it. Without b, a
/// loop that is narrower than its estimate has the larger travel, and the difference would pass for a gain.
///
/// Wrong while motion stays within a few slack widths, by the prior; and by friction that grows with the speed, where the
/// speed depends on the position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GainEstimate {
    /// Last output; None before it.
    last: Option<f64>,
    weight: f64,
    /// Sums of x, d, y - x.
    sums: [f64; 3],
    /// Sums of x^2, x d, d^2, x (y - x), d (y - x).
    products: [f64; 5],
}

impl GainEstimate {
    /// Nothing measured: gain 1.
    pub const fn new() -> Self {
        Self {
            last: None,
            weight: 0.0,
            sums: [0.0; 3],
            products: [0.0; 5],
        }
    }

    /// Update with output, deflection and tip.
    pub fn update(&mut self, output: f64, deflection: f64, tip: f64, window: f64) {
        let travel = self.last.map_or(0.0, |last| (output - last).abs());
        self.last = Some(output);
        let keep = libm::exp(-travel / window);
        let weight = travel.min(LONGEST);
        let (x, d, off) = (output, deflection, tip - output);
        let add = |sum: &mut f64, new: f64| *sum = keep * *sum + weight * new;
        add(&mut self.weight, 1.0);
        for (sum, new) in self.sums.iter_mut().zip([x, d, off]) {
            add(sum, new);
        }
        let products = [x * x, x * d, d * d, x * off, d * off];
        for (sum, new) in self.products.iter_mut().zip(products) {
            add(sum, new);
        }
    }

    /// The gain, with the strength of the prior.
    pub fn value(&self, prior: f64) -> f64 {
        if self.weight == 0.0 {
            return 1.0;
        }
        let ([x, d, off], [xx, xd, dd, x_off, d_off]) = (self.sums, self.products);
        let central = |product: f64, a: f64, b: f64| product - a * b / self.weight;
        let (xx, dd) = (central(xx, x, x) + prior, central(dd, d, d) + prior);
        let (xd, x_off) = (central(xd, x, d), central(x_off, x, off));
        let slope = (dd * x_off - xd * central(d_off, d, off)) / (xx * dd - square(xd));
        (1.0 + slope).clamp(LEAST, LARGEST)
    }
}
