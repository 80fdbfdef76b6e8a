//! The discriminant in fixed point, for one pixel format.

use std::ops::Range;

use fearless_simd::Simd;

use super::active_blocks::BLOCK;
use super::format::PixelFormat;
use super::row::{Consumer, Group, Row};
use super::simd_dot::{self, SimdDot};
use super::simd_gather;

/// Pixels that are scanned together where the compiler vectorises: long enough for its loop, in whole blocks.
const CHUNK: usize = 4 * BLOCK;

/// Largest magnitude of a projected pixel: the low-pass sums four of them in an `i16`, rounding included.
pub const RANGE: f64 = 8190.0;

/// Fraction bits of a weight: with [`RANGE`], the most for which every weight fits an `i16`.
const FRACTION_BITS: u32 = 9;

/// Computes `(w . x + offset) / 512`, rounded, for the three channels x of a pixel, and holds the threshold of the
/// result.
#[derive(Clone, Debug)]
pub struct Projection {
    weights: [i16; 3],
    offset: i32,
    /// Pixels above it are marker, in units of the projected values.
    pub threshold: i16,
    /// See [`mark`](Self::mark).
    coarse_weights: [i16; 3],
    coarse_level: i16,
    simd_dot: SimdDot,
}

impl Projection {
    /// From `weights . x + constant > threshold` and the `scale`, units per unit of that sum, with which no pixel
    /// may leave +-[`RANGE`] and no weight 4 [`RANGE`] / 512.
    pub fn new(weights: [f64; 3], constant: f64, threshold: f64, scale: f64) -> Self {
        let unit = scale * f64::from(1_u32 << FRACTION_BITS);
        let weights = weights.map(|weight| nearest_i16(weight * unit));
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the sum at black is within RANGE units"
        )]
        let offset = (constant * unit).round() as i32 + (1 << (FRACTION_BITS - 1));
        // An integer exceeds a real number exactly if it exceeds the floor of it.
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
            coarse_level,
            simd_dot: SimdDot::new(coarse_weights, coarse_level),
        }
    }

    /// Projects a row; the values stay within +-8191.
    #[inline(always)]
    pub fn project<S: Simd>(&self, simd: S, row: Row<'_>, projected: &mut [i16]) {
        let done = if let Row::Triples(bytes) = row {
            let rounding = (self.offset, FRACTION_BITS);
            simd_gather::project(simd, bytes, self.weights, rounding, projected)
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

    /// Sets the bits of the blocks of a row in which a pixel may exceed the threshold; it misses none. The words must
    /// be 0, and the row must have at least [`least_scan_width`] pixels.
    ///
    /// With W the weights, x a pixel, D > 0: a projected value exceeds the threshold exactly if `W . x >= level`.
    /// Channels are not negative, so `ceil(W / D) . x >= W . x / D`, and an integer that is not below `level / D` is not
    /// below its ceiling. D is the least for which the sum fits an `i16`, which makes it fast; a weight then fits a byte.
    #[inline(always)]
    pub fn mark<S: Simd>(&self, simd: S, row: Row<'_>, width: usize, active: &mut [u64]) {
        if let Row::Triples(bytes) = row
            && simd_dot::is_fast(simd)
        {
            self.simd_dot.mark(simd, bytes, active);
            return;
        }
        let reaches = |columns: Range<usize>| {
            row.columns(columns).feed(Largest(self.coarse_weights)) >= self.coarse_level
        };
        for start in (0..width).step_by(CHUNK) {
            // A shorter last chunk would cost more than testing some pixels twice.
            let tested = start.min(width - CHUNK);
            if !reaches(tested..tested + CHUNK) {
                continue;
            }
            for start in (start..width.min(start + CHUNK)).step_by(BLOCK) {
                if reaches(start..width.min(start + BLOCK))
                    && let Some(word) = active.get_mut(start / BLOCK / 64)
                {
                    *word |= 1 << (start / BLOCK % 64);
                }
            }
        }
    }
}

/// Least pixels of a row for which [`Projection::mark`] is faster than the exact projection.
#[inline(always)]
pub fn least_scan_width<S: Simd>(simd: S, format: PixelFormat) -> usize {
    let is_packed = matches!(format, PixelFormat::Bgr | PixelFormat::Rgb);
    if is_packed && simd_dot::is_fast(simd) {
        BLOCK
    } else {
        CHUNK
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

/// Finds the largest weighted sum; `i16::MIN` without pixels.
struct Largest([i16; 3]);

impl Consumer for Largest {
    type Outcome = i16;

    #[inline(always)]
    fn consume<const P: usize, G: Group<P>>(self, groups: impl Iterator<Item = G>) -> i16 {
        let [first, second, third] = self.0;
        groups.fold(i16::MIN, |mut largest, group| {
            for pixel in 0..P {
                // The sum fits an i16; a partial sum may wrap around and back.
                let sum = first
                    .wrapping_mul(i16::from(group.channel(pixel, 0)))
                    .wrapping_add(second.wrapping_mul(i16::from(group.channel(pixel, 1))))
                    .wrapping_add(third.wrapping_mul(i16::from(group.channel(pixel, 2))));
                largest = largest.max(sum);
            }
            largest
        })
    }
}

fn div_ceil(value: i32, divisor: i32) -> i32 {
    -(-value).div_euclid(divisor)
}

fn clamped_i16(value: i32) -> i16 {
    let limit = if value < 0 { i16::MIN } else { i16::MAX };
    i16::try_from(value).unwrap_or(limit)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a cast from a float saturates"
)]
fn nearest_i16(value: f64) -> i16 {
    value.round() as i16
}
