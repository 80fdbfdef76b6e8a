//! Fisher's linear discriminant, applied: Eq. (12).

use crate::projection::{Projection, RANGE};
use crate::{Error, PixelFormat};

/// Which colours are marker: those with `w_b B + w_g G + w_r R > threshold`, Eq. (12).
///
/// Applied in fixed point. One unit of a projected value is `1 / scale` of the weighted sum, the
/// scale such that no colour leaves +-8190 units. The projection is linear and so is the low-pass:
/// to project first, onto one channel, and to filter that, is to filter three and to project
/// then, at a third of the work. For the same reason Y, U, V need not be made B, G, R first: the
/// matrix goes into the weights.
///
/// Rounding moves a value by at most [`tolerance`](Self::tolerance); a colour farther than that
/// from the threshold is decided as in exact arithmetic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorDiscriminant {
    weights: [f64; 3],
    threshold: f64,
}

/// Weights of the three channels of a format and the weighted sum where all three are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Affine {
    weights: [f64; 3],
    constant: f64,
}

impl ColorDiscriminant {
    /// From the weights of blue, green and red and the threshold, in the unit of the weighted sum
    /// (grey levels, if the largest weight is 1).
    ///
    /// # Errors
    /// A number is not finite, or all weights are zero, or so small or large that they cannot be meant.
    pub fn new(weights: [f64; 3], threshold: f64) -> Result<Self, Error> {
        let affine = Affine {
            weights,
            constant: 0.0,
        };
        let finite = weights.iter().all(|weight| weight.is_finite());
        if !finite || !(1e-6..=1e9).contains(&affine.reach()) {
            let allowed = "finite weights of B, G, R, the largest magnitude 1e-8 to 1e6";
            return Err(Error::new("weights", &weights, allowed));
        }
        if !threshold.is_finite() {
            return Err(Error::new("threshold", &threshold, "a finite number"));
        }
        Ok(Self { weights, threshold })
    }

    /// Bound of the rounding errors in the unit of the weighted sum, after `passes` of the low-pass.
    ///
    /// `(1.25 + passes) / scale`: half a bit of each weight times 255 makes 0.75 units, rounding the sum
    /// half a unit, each pass one. For weights like (-0.2, 1, -0.8): 0.04 grey levels and 0.03 per pass
    /// from B, G, R, and from Y, U, V, whose cube holds colours that cannot be seen, 0.06 and 0.05.
    pub fn tolerance(&self, format: PixelFormat, passes: usize) -> f64 {
        let passes = u32::try_from(passes).map_or(f64::INFINITY, f64::from);
        (1.25 + passes) * self.affine(format).reach() / RANGE
    }

    pub(crate) fn projection(&self, format: PixelFormat) -> Projection {
        let affine = self.affine(format);
        let scale = RANGE / affine.reach();
        Projection::new(affine.weights, affine.constant, self.threshold, scale)
    }

    /// Weights of a format's three channels, and the constant, that make `weights . [B, G, R]`.
    pub(crate) fn affine_of(weights: [f64; 3], format: PixelFormat) -> ([f64; 3], f64) {
        let discriminant = Self {
            weights,
            threshold: 0.0,
        };
        let Affine { weights, constant } = discriminant.affine(format);
        (weights, constant)
    }

    /// The weighted sum as a function of the channels in the order in which the format's rows give them.
    ///
    /// Y, U, V as cameras give them, ITU-R BT.601 with limited range: Y 16 to 235, U and V 16 to 240 about 128,
    ///
    /// ```text
    /// B = 255/219 (Y - 16) + 255/112 0.886 (U - 128)
    /// R = 255/219 (Y - 16) + 255/112 0.701 (V - 128)
    /// G = (Y' - 0.114 B - 0.299 R) / 0.587,   Y' = 255/219 (Y - 16)
    /// ```
    ///
    /// Linear, without a clamp: a Y, U, V outside the cube of B, G, R weighs what the formula says. It errs
    /// on cameras that give the full range or BT.709.
    fn affine(&self, format: PixelFormat) -> Affine {
        let [blue, green, red] = self.weights;
        match format {
            PixelFormat::Bgr | PixelFormat::Bgra => Affine {
                weights: self.weights,
                constant: 0.0,
            },
            PixelFormat::Rgb => Affine {
                weights: [red, green, blue],
                constant: 0.0,
            },
            PixelFormat::Yuyv | PixelFormat::Uyvy | PixelFormat::Nv12 | PixelFormat::I420 => {
                let luma = 255.0 / 219.0 * (blue + green + red);
                let u = 255.0 / 112.0 * 0.886 * (blue - 0.114 / 0.587 * green);
                let v = 255.0 / 112.0 * 0.701 * (red - 0.299 / 0.587 * green);
                Affine {
                    weights: [luma, u, v],
                    constant: -16.0 * luma - 128.0 * (u + v),
                }
            }
        }
    }
}

impl Affine {
    /// The largest magnitude of the weighted sum over all bytes; at least half of what a channel spans.
    fn reach(&self) -> f64 {
        let side = |sign: f64| {
            self.weights
                .iter()
                .map(|w| (sign * w).max(0.0))
                .sum::<f64>()
        };
        let (most, least) = (
            self.constant + 255.0 * side(1.0),
            self.constant - 255.0 * side(-1.0),
        );
        let half = self.weights.iter().fold(0.0, |most, w| w.abs().max(most)) * 128.0;
        most.abs().max(least.abs()).max(half)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn senseless_numbers_are_refused_by_name() {
        let refused = |weights, threshold| {
            ColorDiscriminant::new(weights, threshold)
                .unwrap_err()
                .field
        };
        assert_eq!(refused([0.0; 3], 0.0), "weights");
        assert_eq!(refused([f64::NAN, 1.0, 1.0], 0.0), "weights");
        assert_eq!(refused([f64::INFINITY, 1.0, 1.0], 0.0), "weights");
        assert_eq!(refused([1e300, 1.0, 1.0], 0.0), "weights");
        assert_eq!(refused([1.0; 3], f64::NAN), "threshold");
    }
}
