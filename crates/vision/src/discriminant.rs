//! Fisher's linear discriminant, applied: Eq. (12).

use crate::Error;

/// Largest magnitude of a projected pixel: four of them still fit an `i16`, which the low-pass needs.
const RANGE: f64 = 8190.0;

/// Fraction bits of a weight: 255 times the largest weight is `RANGE`, so it fits an `i16`.
const FRACTION_BITS: u32 = 9;

/// Which colours are marker: those with `w_b B + w_g G + w_r R > threshold`, Eq. (12).
///
/// Applied in fixed point. One unit of a projected value is `1 / scale` of the weighted sum, the
/// scale such that no colour leaves +-8190 units. The projection is linear and so is the low-pass:
/// to project first, onto one channel, and to filter that, is to filter three and to project
/// then, at a third of the work.
///
/// Rounding moves a value by at most [`tolerance`](Self::tolerance); a colour farther than that
/// from the threshold is decided as in exact arithmetic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorDiscriminant {
    weights: [i16; 3],
    threshold: i16,
    scale: f64,
}

impl ColorDiscriminant {
    /// From the weights of blue, green and red and the threshold, in the unit of the weighted sum
    /// (grey levels, if the largest weight is 1).
    ///
    /// # Errors
    /// A number is not finite, or all weights are zero, or so small or large that they cannot be meant.
    pub fn new(weights: [f64; 3], threshold: f64) -> Result<Self, Error> {
        let side = |sign: f64| weights.iter().map(|w| (sign * w).max(0.0)).sum::<f64>();
        let reach = 255.0 * side(1.0).max(side(-1.0));
        let finite = weights.iter().all(|weight| weight.is_finite());
        if !finite || !(1e-6..=1e9).contains(&reach) {
            let allowed = "finite weights of B, G, R, the largest magnitude 1e-8 to 1e6";
            return Err(Error::new("weights", &weights, allowed));
        }
        if !threshold.is_finite() {
            return Err(Error::new("threshold", &threshold, "a finite number"));
        }
        let scale = RANGE / reach;
        let unit = scale * f64::from(1_u32 << FRACTION_BITS);
        Ok(Self {
            weights: weights.map(|weight| to_i16(weight * unit)),
            // A whole number exceeds a real one exactly when it exceeds the real one's floor.
            threshold: to_i16((threshold * scale).floor()),
            scale,
        })
    }

    /// Bound of the rounding errors in the unit of the weighted sum, after `passes` of the low-pass.
    ///
    /// `(1.25 + passes) / scale`: half a bit of each weight times 255 makes 0.75 units, rounding the sum
    /// half a unit, each pass one. For weights like (-0.2, 1, -0.8): 0.04 grey levels and 0.03 per pass.
    pub fn tolerance(&self, passes: usize) -> f64 {
        let passes = u32::try_from(passes).map_or(f64::INFINITY, f64::from);
        (1.25 + passes) / self.scale
    }

    /// The threshold in units of the projected values: marker is what exceeds it.
    pub(crate) fn threshold(&self) -> i16 {
        self.threshold
    }

    /// Projects a row of B, G, R bytes; the result stays within +-8191.
    pub(crate) fn project(&self, bgr: &[u8], projected: &mut [i16]) {
        let [blue, green, red] = self.weights.map(i32::from);
        for (value, pixel) in projected.iter_mut().zip(bgr.chunks_exact(3)) {
            let sum = blue * i32::from(pixel[0])
                + green * i32::from(pixel[1])
                + red * i32::from(pixel[2]);
            #[expect(clippy::cast_possible_truncation, reason = "within +-8191")]
            {
                *value = ((sum + (1 << (FRACTION_BITS - 1))) >> FRACTION_BITS) as i16;
            }
        }
    }
}

/// The nearest `i16`.
fn to_i16(value: f64) -> i16 {
    let limits = (f64::from(i16::MIN), f64::from(i16::MAX));
    #[expect(
        clippy::cast_possible_truncation,
        reason = "clamped to the type's range"
    )]
    {
        value.round().clamp(limits.0, limits.1) as i16
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn fixed_point_decides_as_exact_arithmetic(
            weights in prop::array::uniform3(-2.0..2.0_f64),
            threshold in -300.0..300.0_f64,
            pixels in prop::collection::vec(any::<[u8; 3]>(), 1..50),
        ) {
            let Ok(discriminant) = ColorDiscriminant::new(weights, threshold) else {
                return Ok(());
            };
            let mut projected = vec![0; pixels.len()];
            discriminant.project(pixels.as_flattened(), &mut projected);
            for (pixel, value) in pixels.iter().zip(projected) {
                prop_assert!(value.abs() <= 8191);
                let exact: f64 = weights.iter().zip(pixel).map(|(w, p)| w * f64::from(*p)).sum();
                let fixed = f64::from(value) / discriminant.scale;
                prop_assert!((fixed - exact).abs() <= discriminant.tolerance(0));
                if (exact - threshold).abs() > discriminant.tolerance(0) {
                    prop_assert_eq!(value > discriminant.threshold(), exact > threshold);
                }
            }
        }
    }

    #[test]
    fn extreme_colours_stay_in_range() {
        for weights in [
            [1.0, 1.0, 1.0],
            [-1.0, -1.0, -1.0],
            [1e6, -1e6, 0.3],
            [0.0, 0.0, 1e-8],
        ] {
            let discriminant = ColorDiscriminant::new(weights, 0.0).unwrap();
            for colour in [[0, 0, 0], [255; 3], [255, 0, 0], [0, 255, 0], [0, 0, 255]] {
                let mut value = [0];
                discriminant.project(&colour, &mut value);
                assert!(value[0].abs() <= 8191, "{weights:?} {colour:?} {value:?}");
            }
        }
    }

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
