//! The discriminant in fixed point, for one pixel format.

use std::ops::Range;

use fearless_simd::Simd;

use crate::PixelFormat;
use crate::columns::BLOCK;
use crate::format::{Consumer, Group, Row};
use crate::pairs::{self, Pairs};
use crate::triples;

/// Pixels that are scanned together where the compiler vectorises: whole blocks.
const AT_ONCE: usize = 4 * BLOCK;

/// Largest magnitude of a projected pixel: four of them still fit an `i16`, which the low-pass needs.
pub(crate) const RANGE: f64 = 8190.0;

/// Fraction bits of a weight.
const FRACTION_BITS: u32 = 9;

/// `(w . x + offset) / 512` to the nearest, halves upwards, for the three channels x of a pixel, and
/// the threshold it is held against.
#[derive(Clone, Debug)]
pub(crate) struct Projection {
    weights: [i16; 3],
    offset: i32,
    threshold: i16,
    /// What [`mark`](Self::mark) goes by.
    coarse_weights: [i16; 3],
    pairs: Pairs,
    coarse_level: i16,
}

impl Projection {
    /// From `weights . x + constant > threshold` and the units per unit of that sum: with `scale`
    /// units no pixel may leave +-[`RANGE`], and no weight 4 [`RANGE`] / 512.
    pub(crate) fn new(weights: [f64; 3], constant: f64, threshold: f64, scale: f64) -> Self {
        let unit = scale * f64::from(1_u32 << FRACTION_BITS);
        let weights = weights.map(|weight| nearest_i16(weight * unit));
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the sum at black is within RANGE units"
        )]
        let offset = (constant * unit).round() as i32 + (1 << (FRACTION_BITS - 1));
        // A whole number exceeds a real one exactly when it exceeds the real one's floor.
        let threshold = nearest_i16((threshold * scale).floor());
        let wide = weights.map(i32::from);
        let side = |sign: i32| {
            wide.iter()
                .map(|weight| (sign * weight).max(0))
                .sum::<i32>()
        };
        let limit = i32::from(i16::MAX);
        // Upward rounding adds less than 1 to each of the three.
        let divisor = 255 * side(1).max(side(-1)) / (limit - 3 * 255) + 1;
        let level = ((i32::from(threshold) + 1) << FRACTION_BITS) - offset;
        let coarse_weights = wide.map(|weight| clamped_i16(div_ceil(weight, divisor)));
        let coarse_level = clamped_i16(div_ceil(level, divisor));
        Self {
            weights,
            offset,
            threshold,
            coarse_weights,
            pairs: Pairs::new(coarse_weights, coarse_level),
            coarse_level,
        }
    }

    /// Marker is what exceeds it, in units of the projected values.
    pub(crate) fn threshold(&self) -> i16 {
        self.threshold
    }

    /// Projects a row; the result stays within +-8191.
    #[inline(always)]
    pub(crate) fn project<S: Simd>(&self, simd: S, row: Row<'_>, projected: &mut [i16]) {
        let done = if let Row::Triples(bytes) = row {
            let rounding = (self.offset, FRACTION_BITS);
            triples::project(simd, bytes, self.weights, rounding, projected)
        } else {
            0
        };
        if let Some(rest) = projected.get_mut(done..)
            && !rest.is_empty()
        {
            let columns = done..done + rest.len();
            row.columns(columns).feed(Project(self, rest));
        }
    }

    /// Sets the bits of the blocks of a row in which a pixel may exceed the threshold, in words that are 0: it
    /// misses none. The row has the pixels that make it [worth it](worth_a_look).
    ///
    /// With W the weights, x a pixel, D > 0: a projected value exceeds the threshold exactly if
    /// `W . x >= level`. Channels are not negative, so `ceil(W / D) . x >= W . x / D`, and a whole number that
    /// is not below `level / D` is not below its ceiling. D is the least for which the sum fits an
    /// `i16`, which is what makes it quick; then a weight fits a byte.
    #[inline(always)]
    pub(crate) fn mark<S: Simd>(&self, simd: S, row: Row<'_>, width: usize, hot: &mut [u64]) {
        if let Row::Triples(bytes) = row
            && pairs::are_quick(simd)
        {
            self.pairs.mark(simd, bytes, hot);
            return;
        }
        let reaches = |columns: Range<usize>| {
            row.columns(columns).feed(Peak(self.coarse_weights)) >= self.coarse_level
        };
        for start in (0..width).step_by(AT_ONCE) {
            // What is cut short costs more than what was looked at in part before.
            let tested = start.min(width - AT_ONCE);
            if !reaches(tested..tested + AT_ONCE) {
                continue;
            }
            for start in (start..width.min(start + AT_ONCE)).step_by(BLOCK) {
                if reaches(start..width.min(start + BLOCK))
                    && let Some(word) = hot.get_mut(start / BLOCK / 64)
                {
                    *word |= 1 << (start / BLOCK % 64);
                }
            }
        }
    }
}

/// How many pixels a row must have at least for [`Projection::mark`] to be quicker than the exact way.
#[inline(always)]
pub(crate) fn worth_a_look<S: Simd>(simd: S, format: PixelFormat) -> usize {
    let triples = matches!(format, PixelFormat::Bgr | PixelFormat::Rgb);
    if triples && pairs::are_quick(simd) {
        BLOCK
    } else {
        AT_ONCE
    }
}

struct Project<'a>(&'a Projection, &'a mut [i16]);

impl Consumer for Project<'_> {
    type Outcome = ();

    #[inline(always)]
    fn consume<const P: usize, G: Group<P>>(self, groups: impl Iterator<Item = G>) {
        let Self(projection, projected) = self;
        let [first, second, third] = projection.weights.map(i32::from);
        for (values, group) in projected.as_chunks_mut::<P>().0.iter_mut().zip(groups) {
            for (pixel, value) in values.iter_mut().enumerate() {
                let sum = first * i32::from(group.channel(pixel, 0))
                    + second * i32::from(group.channel(pixel, 1))
                    + third * i32::from(group.channel(pixel, 2))
                    + projection.offset;
                #[expect(clippy::cast_possible_truncation, reason = "within +-8191")]
                {
                    *value = (sum >> FRACTION_BITS) as i16;
                }
            }
        }
    }
}

/// The largest weighted sum, or `i16::MIN` of no pixels.
struct Peak([i16; 3]);

impl Consumer for Peak {
    type Outcome = i16;

    #[inline(always)]
    fn consume<const P: usize, G: Group<P>>(self, groups: impl Iterator<Item = G>) -> i16 {
        let [first, second, third] = self.0;
        groups.fold(i16::MIN, |mut peak, group| {
            for pixel in 0..P {
                // The sum fits; a part of it may not, and comes back.
                let sum = first
                    .wrapping_mul(i16::from(group.channel(pixel, 0)))
                    .wrapping_add(second.wrapping_mul(i16::from(group.channel(pixel, 1))))
                    .wrapping_add(third.wrapping_mul(i16::from(group.channel(pixel, 2))));
                peak = peak.max(sum);
            }
            peak
        })
    }
}

fn div_ceil(value: i32, divisor: i32) -> i32 {
    -(-value).div_euclid(divisor)
}

fn clamped_i16(value: i32) -> i16 {
    let limits = (i32::from(i16::MIN), i32::from(i16::MAX));
    #[expect(
        clippy::cast_possible_truncation,
        reason = "clamped to the type's range"
    )]
    {
        value.clamp(limits.0, limits.1) as i16
    }
}

fn nearest_i16(value: f64) -> i16 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a cast from a float saturates"
    )]
    {
        value.round() as i16
    }
}
