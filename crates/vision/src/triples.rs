//! Pixels of three bytes, where vectors can be told to multiply bytes in pairs or to pick among them.
//!
//! Elsewhere, and for the other formats, what the compiler makes of [`Group`](crate::format::Group) is
//! as fast.

use fearless_simd::{i16x32, i32x16, prelude::*, u8x64};

use crate::columns::BLOCK;

/// Bytes of a block of pixels.
const BYTES: usize = 3 * BLOCK;

/// Weights of bytes that are multiplied in pairs where they lie, for vectors of 64 and of 32 bytes, and the
/// level the sums are held against.
///
/// The sum of pixels 2 k and 2 k + 1, bytes 6 k to 6 k + 5, comes out at byte 6 k and 6 k + 2: of the pair there
/// and of the pair one further on. What comes out at 6 k + 4 is of no pixel, and 0.
#[derive(Clone, Debug)]
pub(crate) struct Pairs {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    of_64: [Vector<64>; 3],
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    of_32: [Vector<32>; 3],
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    level: i16,
}

/// The weights of the bytes of one of three vectors that cover 3 N bytes, and of those two further on.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
type Vector<const N: usize> = [[i8; N]; 2];

/// Where the three begin; the last two bytes are only read as those further on.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
const fn starts(bytes: usize) -> [usize; 3] {
    [0, bytes, 2 * bytes - 2]
}

impl Pairs {
    /// Of the channels' weights, which fit a byte; 255 times the sum of those of one sign is below `i16::MAX`.
    pub(crate) fn new(weights: [i16; 3], level: i16) -> Self {
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        let _ = (weights, level);
        Self {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            of_64: starts(64).map(|start| vector(start, weights)),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            of_32: starts(32).map(|start| vector(start, weights)),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            level,
        }
    }

    /// Sets the bit of each block in which `weights . x >= level` for a pixel x, in words that are 0; of every
    /// block where black reaches the level too. A last block that is cut short counts what it lacks from the one
    /// before it.
    ///
    /// Does nothing where it [is not quick](are_quick).
    #[inline(always)]
    pub(crate) fn mark<S: Simd>(&self, simd: S, bytes: &[u8], hot: &mut [u64]) {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        if let Some(wide) = simd.level().as_avx512() {
            mark(wide, bytes, (&self.of_64, self.level), hot);
        } else if let Some(wide) = simd.level().as_avx2() {
            mark(wide, bytes, (&self.of_32, self.level), hot);
        }
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        let _ = (simd, bytes, hot);
    }
}

/// Whether [`Pairs::mark`] is for this machine.
#[inline(always)]
pub(crate) fn are_quick<S: Simd>(simd: S) -> bool {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    return simd.level().as_avx2().is_some();
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
    {
        let _ = simd;
        false
    }
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
fn vector<const N: usize>(start: usize, weights: [i16; 3]) -> Vector<N> {
    #[expect(clippy::cast_possible_truncation, reason = "they fit")]
    let [first, second, third] = weights.map(|weight| weight as i8);
    let mut both = [[0; N]; 2];
    let [here, further] = &mut both;
    let pairs = here.as_chunks_mut().0.iter_mut();
    let pairs = pairs.zip(further.as_chunks_mut().0);
    for ((here, further), at) in pairs.zip((start..).step_by(2)) {
        (*here, *further) = match at % 6 {
            0 => ([first, second], [third, 0]),
            2 => ([0, first], [second, third]),
            _ => ([0, 0], [0, 0]),
        };
    }
    both
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
#[inline(always)]
fn mark<S: Dot, const N: usize>(
    simd: S,
    bytes: &[u8],
    (vectors, level): (&[Vector<N>; 3], i16),
    hot: &mut [u64],
) {
    let loaded = Loaded::new(simd, vectors, level);
    let (blocks, rest) = bytes.as_chunks::<BYTES>();
    for (word, blocks) in hot.iter_mut().zip(blocks.chunks(64)) {
        let mut bits = 0;
        for (bit, block) in blocks.iter().enumerate() {
            bits |= u64::from(loaded.is_reached::<N>(simd, block)) << bit;
        }
        *word = bits;
    }
    if !rest.is_empty()
        && let Some(last) = bytes.last_chunk()
        && let Some(word) = hot.get_mut(blocks.len() / 64)
    {
        *word |= u64::from(loaded.is_reached::<N>(simd, last)) << (blocks.len() % 64);
    }
}

/// The weights and the level in registers: left in memory, they are loaded more often than the bytes.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
struct Loaded<S: Simd> {
    weights: [[S::i8s; 2]; 3],
    least: S::i16s,
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
impl<S: Dot> Loaded<S> {
    #[inline(always)]
    fn new<const N: usize>(simd: S, [a, b, c]: &[Vector<N>; 3], level: i16) -> Self {
        Self {
            weights: [
                [
                    S::i8s::from_slice(simd, &a[0]),
                    S::i8s::from_slice(simd, &a[1]),
                ],
                [
                    S::i8s::from_slice(simd, &b[0]),
                    S::i8s::from_slice(simd, &b[1]),
                ],
                [
                    S::i8s::from_slice(simd, &c[0]),
                    S::i8s::from_slice(simd, &c[1]),
                ],
            ],
            least: S::i16s::splat(simd, level),
        }
    }

    /// Whether a pixel of a block does.
    #[inline(always)]
    fn is_reached<const N: usize>(&self, simd: S, block: &[u8; BYTES]) -> bool {
        let mut most = S::i16s::splat(simd, i16::MIN);
        for part in block.chunks_exact(3 * N) {
            for ([here, further], start) in self.weights.iter().zip(starts(N)) {
                let bytes = S::u8s::from_slice(simd, &part[start..start + N]);
                let sum = simd.dot(bytes, *here);
                let bytes = S::u8s::from_slice(simd, &part[start + 2..start + 2 + N]);
                most = most.max(sum + simd.dot(bytes, *further));
            }
        }
        most.simd_ge(self.least).any_true()
    }
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod dot {
    #[cfg(target_arch = "x86")]
    use std::arch::x86::{_mm256_maddubs_epi16, _mm512_maddubs_epi16};
    #[cfg(target_arch = "x86_64")]
    use std::arch::x86_64::{_mm256_maddubs_epi16, _mm512_maddubs_epi16};

    use fearless_simd::{
        Avx2, Avx512, i8x32, i8x64, i16x16, i16x32, kernel, prelude::*, u8x32, u8x64,
    };

    /// Bytes times weights, summed in pairs; no sum may leave an `i16`.
    pub(super) trait Dot: Simd {
        fn dot(self, bytes: Self::u8s, weights: Self::i8s) -> Self::i16s;
    }

    impl Dot for Avx512 {
        #[inline(always)]
        fn dot(self, bytes: u8x64<Self>, weights: i8x64<Self>) -> i16x32<Self> {
            dot_64(self, bytes, weights)
        }
    }

    impl Dot for Avx2 {
        #[inline(always)]
        fn dot(self, bytes: u8x32<Self>, weights: i8x32<Self>) -> i16x16<Self> {
            dot_32(self, bytes, weights)
        }
    }

    kernel!(
        #[inline(always)]
        fn dot_64(simd: Avx512, a: u8x64<Avx512>, b: i8x64<Avx512>) -> i16x32<Avx512> {
            _mm512_maddubs_epi16(a.into(), b.into()).simd_into(simd)
        }
    );

    kernel!(
        #[inline(always)]
        fn dot_32(simd: Avx2, a: u8x32<Avx2>, b: i8x32<Avx2>) -> i16x16<Avx2> {
            _mm256_maddubs_epi16(a.into(), b.into()).simd_into(simd)
        }
    );
}
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
use dot::Dot;

/// Pixels in a vector of 32-bit sums.
const LANES: usize = 16;

/// By pixel: its first and second byte, then its third, each made 16 bits; 64 and above is 0.
const PICKS: [[[u8; 64]; 2]; 2] = [picks(0), picks(16)];

/// `(weights . x + offset) >> bits` of the pixels x of whole blocks, and how many pixels that was.
#[inline(always)]
pub(crate) fn project<S: Simd>(
    simd: S,
    bytes: &[u8],
    weights: [i16; 3],
    (offset, bits): (i32, u32),
    projected: &mut [i16],
) -> usize {
    if S::u8s::LEN != 64 {
        return 0;
    }
    // Two weights to a lane of 32 bits, the first the lower; the third goes with a zero.
    let [first, second, third] = weights.map(|weight| i32::from(weight) & 0xffff);
    let rest = (
        i32x16::splat(simd, first | second << 16).bitcast(),
        i32x16::splat(simd, third).bitcast(),
        i32x16::splat(simd, offset),
    );
    let blocks = bytes.as_chunks::<BYTES>().0;
    let outputs = projected.as_chunks_mut::<BLOCK>().0;
    for (block, output) in blocks.iter().zip(&mut *outputs) {
        let (left, right) = output.split_at_mut(2 * LANES);
        let [a, b] = [sums(simd, block, 0, rest), sums(simd, block, 1, rest)];
        simd.narrow_i32x16(a >> bits, b >> bits).store_slice(left);
        let [a, b] = [sums(simd, block, 2, rest), sums(simd, block, 3, rest)];
        simd.narrow_i32x16(a >> bits, b >> bits).store_slice(right);
    }
    blocks.len().min(outputs.len()) * BLOCK
}

/// The weighted sums of a quarter of a block: `here` are the weights of the first two channels, `further` that of
/// the third.
#[inline(always)]
fn sums<S: Simd>(
    simd: S,
    block: &[u8; BYTES],
    quarter: usize,
    (here, further, offset): (i16x32<S>, i16x32<S>, i32x16<S>),
) -> i32x16<S> {
    // The last is read from farther left, so as not to read beyond the block.
    let start = (quarter * 3 * LANES).min(BYTES - 64);
    let [two, one] = &PICKS[usize::from(quarter == 3)];
    let pixels = u8x64::from_slice(simd, &block[start..start + 64]);
    let zero = u8x64::splat(simd, 0);
    let two = pixels.concat_swizzle_dyn(zero, u8x64::from_slice(simd, two));
    let one = pixels.concat_swizzle_dyn(zero, u8x64::from_slice(simd, one));
    simd.pairwise_dot_product_i16x32(two.bitcast(), here)
        + simd.pairwise_dot_product_i16x32(one.bitcast(), further)
        + offset
}

#[expect(clippy::cast_possible_truncation, reason = "below 65")]
const fn picks(shift: usize) -> [[u8; 64]; 2] {
    let mut picks = [[64; 64]; 2];
    let mut pixel = 0;
    while pixel < LANES {
        let at = shift + 3 * pixel;
        picks[0][4 * pixel] = at as u8;
        picks[0][4 * pixel + 2] = at as u8 + 1;
        picks[1][4 * pixel] = at as u8 + 2;
        pixel += 1;
    }
    picks
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use proptest::prelude::*;

    fn levels() -> Vec<Level> {
        let best = Level::new();
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        let narrower = best.as_avx2().map(Simd::level);
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        let narrower = None;
        [Some(best), narrower, Some(Level::baseline())]
            .into_iter()
            .flatten()
            .collect()
    }

    proptest! {
        #[test]
        fn marks_the_blocks_of_pixels_that_reach(
            bytes in (BLOCK..5 * BLOCK, any::<bool>()).prop_flat_map(|(pixels, dark)| {
                let most = if dark { 3_u8 } else { 255 };
                prop::collection::vec(prop_oneof![20 => 0..=most, 1 => Just(255)], 3 * pixels)
            }),
            weights in prop_oneof![
                [-42..42_i16, -42..42_i16, -42..42_i16],
                Just([-66, 127, -61]),
                Just([-127, 127, -1]),
                Just([127, -127, 1]),
            ],
            pick in any::<prop::sample::Index>(),
            above in 0..2_i16,
        ) {
            let sum = |pixel: &[u8; 3]| -> i16 {
                pixel.iter().zip(weights).map(|(x, weight)| i16::from(*x) * weight).sum()
            };
            let (pixels, _) = bytes.as_chunks::<3>();
            // At a sum that occurs the answer changes.
            let level = sum(&pixels[pick.index(pixels.len())]).saturating_add(above);
            let reaches =
                |pixels: &[[u8; 3]]| level <= 0 || pixels.iter().any(|pixel| sum(pixel) >= level);
            let (whole, rest) = pixels.as_chunks::<BLOCK>();
            let mut expected: Vec<bool> = whole.iter().map(|block| reaches(block)).collect();
            if !rest.is_empty() {
                expected.push(reaches(&pixels[pixels.len() - BLOCK..]));
            }
            for simd in levels() {
                let mut hot = [0];
                let can = dispatch!(simd, simd => {
                    Pairs::new(weights, level).mark(simd, &bytes, &mut hot);
                    are_quick(simd)
                });
                let marked: Vec<bool> =
                    (0..expected.len()).map(|bit| hot[0] >> bit & 1 == 1).collect();
                prop_assert!(!can || marked == expected, "{:?}: {:?}", simd, marked);
                prop_assert!(can || hot == [0]);
            }
        }

        #[test]
        fn projects_as_pixel_by_pixel(
            bytes in prop::collection::vec(any::<u8>(), 0..3 * 3 * BLOCK),
            weights in prop::array::uniform3(-21_000..=21_000_i16),
            offset in -500_000..500_000,
        ) {
            for simd in levels() {
                let (pixels, _) = bytes.as_chunks::<3>();
                let mut projected = vec![0; pixels.len()];
                let done = dispatch!(simd, simd => project(simd, &bytes, weights, (offset, 9), &mut projected));
                prop_assert!(done == 0 || done == pixels.len() / BLOCK * BLOCK);
                for (pixel, value) in pixels.iter().zip(&projected[..done]) {
                    let terms = pixel.iter().zip(weights);
                    let sum: i32 = terms.map(|(x, weight)| i32::from(*x) * i32::from(weight)).sum();
                    prop_assert_eq!(i32::from(*value), (sum + offset) >> 9);
                }
            }
        }
    }
}
