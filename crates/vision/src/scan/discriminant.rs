//! Fisher's linear discriminant, Eq. (12).

use super::format::PixelFormat;
use super::frame::Frame;
use super::projection::{Projection, RANGE};
use super::row::Row;
use crate::error::Error;
use crate::math::floor;

/// Classifies colours: marker are those with `w_b B + w_g G + w_r R > threshold`, Eq. (12).
///
/// It is applied in fixed point. One unit of a projected value is `1 / scale` of the weighted sum, with the scale chosen
/// such that no colour leaves +-8190 units. Projection and low-pass are linear, so projecting first and filtering one
/// channel equals filtering three channels and projecting then, at a third of the work. For the same reason Y, U, V are
/// not converted to B, G, R: the conversion matrix is part of the weights.
///
/// Rounding moves a value by at most `(1.25 + passes) / scale` after `passes` of the low-pass: half a bit of each weight
/// times 255 makes 0.75 units, rounding the sum half a unit, each pass one. For weights like (-0.2, 1, -0.8) that is 0.04
/// grey levels and 0.03 per pass from B, G, R, and 0.06 and 0.05 from Y, U, V, whose cube has colours that do not exist.
/// A colour farther from the threshold is classified as in exact arithmetic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorDiscriminant {
    weights: [f64; 3],
    threshold: f64,
}

/// Weights of the three channels of a format, and the weighted sum where all three are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// Weights of the channels in the order of [`Row::pixel`].
    pub weights: [f64; 3],
    /// Weighted sum at 0.
    pub constant: f64,
}

impl ColorDiscriminant {
    /// From the weights of blue, green and red and the threshold, in the unit of the weighted sum (grey levels if the
    /// largest weight is 1).
    ///
    /// # Errors
    /// A number is not finite, or all weights are zero, or they are outside the range of the fixed-point arithmetic; or the threshold is
    /// larger than the largest magnitude of the weighted sum.
    pub fn new(weights: [f64; 3], threshold: f64) -> Result<Self, Error> {
        let affine = Affine::new(weights, PixelFormat::Bgr);
        let finite = weights.iter().all(|weight| weight.is_finite());
        if !finite || !(1e-6..=1e9).contains(&affine.reach()) {
            let allowed = "finite weights of B, G, R, the largest magnitude 1e-8 to 1e6";
            return Err(Error::new("weights", &weights, allowed));
        }
        if !(-affine.reach()..=affine.reach()).contains(&threshold) {
            let allowed = "a finite number that the weighted sum of a pixel can have";
            return Err(Error::new("threshold", &threshold, allowed));
        }
        Ok(Self { weights, threshold })
    }

    /// The projection for the pixels of a format.
    pub(crate) fn projection(&self, format: PixelFormat) -> Projection {
        let affine = Affine::new(self.weights, format);
        let scale = RANGE / affine.reach();
        Projection::new(affine.weights, affine.constant, self.threshold, scale)
    }
}

impl Affine {
    /// The weighted sum of B, G, R as a function of a format's three channels.
    ///
    /// Y, U, V follow ITU-R BT.601 with limited range: Y 16 to 235, U and V 16 to 240 about 128,
    ///
    /// ```text
    /// B = 255/219 (Y - 16) + 255/112 0.886 (U - 128)
    /// R = 255/219 (Y - 16) + 255/112 0.701 (V - 128)
    /// G = (Y' - 0.114 B - 0.299 R) / 0.587,   Y' = 255/219 (Y - 16)
    /// ```
    ///
    /// Y, U, V outside the cube of B, G, R are not clamped.
    ///
    /// Wrong when a camera gives the full range or BT.709.
    pub fn new([blue, green, red]: [f64; 3], format: PixelFormat) -> Self {
        let (weights, constant) = match format {
            PixelFormat::Bgr | PixelFormat::Bgra => ([blue, green, red], 0.0),
            PixelFormat::Rgb => ([red, green, blue], 0.0),
            PixelFormat::Yuyv | PixelFormat::Uyvy | PixelFormat::Nv12 | PixelFormat::I420 => {
                let luma = 255.0 / 219.0 * (blue + green + red);
                let u = 255.0 / 112.0 * 0.886 * (blue - 0.114 / 0.587 * green);
                let v = 255.0 / 112.0 * 0.701 * (red - 0.299 / 0.587 * green);
                ([luma, u, v], -16.0 * luma - 128.0 * (u + v))
            }
        };
        Self { weights, constant }
    }

    /// The weighted sum of a pixel's channels.
    pub fn of(&self, pixel: [u8; 3]) -> f64 {
        let terms = self.weights.iter().zip(pixel);
        terms.fold(self.constant, |sum, (weight, value)| {
            sum + weight * f64::from(value)
        })
    }

    /// The weighted sum of the pixel nearest to `[u, v]` (px); None outside the frame.
    pub fn at(&self, frame: &impl Frame, [u, v]: [f64; 2]) -> Option<f64> {
        if !(u >= -0.5 && v >= -0.5) {
            return None;
        }
        let (column, row) = (floor(u + 0.5), floor(v + 0.5));
        let is_inside = column < frame.width() && row < frame.height();
        is_inside.then(|| self.of(Row::of(frame, row).pixel(column)))
    }

    /// The largest magnitude of the weighted sum over all bytes; at least half of the range of a channel.
    fn reach(&self) -> f64 {
        let extreme = |sign: f64| {
            let side: f64 = self.weights.iter().map(|w| (sign * w).max(0.0)).sum();
            (self.constant + sign * 255.0 * side).abs()
        };
        let half = self.weights.iter().fold(0.0, |most, w| w.abs().max(most)) * 128.0;
        extreme(1.0).max(extreme(-1.0)).max(half)
    }
}
