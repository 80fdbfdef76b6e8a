//! Pixels of three bytes, where vectors can be told to multiply bytes in pairs or to pick among them.
//!
//! Elsewhere, and for the other formats, what the compiler makes of [`Group`](crate::format::Group) is
//! as fast.

use fearless_simd::{i16x32, i32x16, prelude::*, u8x64};

use crate::columns::BLOCK;

/// Bytes of a block of pixels.
const BYTES: usize = 3 * BLOCK;

/// Weights of bytes that are multiplied in pairs where they lie, for vectors of 64 and of 32 bytes.
///
/// The sum of pixels 2 k and 2 k + 1, bytes 6 k to 6 k + 5, comes out at byte 6 k and 6 k + 2: of the pair there
/// and of the pair one further on. A pair at 6 k + 4 is worth nothing.
#[derive(Clone, Debug)]
pub(crate) struct Pairs {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    of_64: Weights<64>,
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    of_32: Weights<32>,
}

/// By vector: the weights of its bytes and of the bytes two further on.
type Weights<const N: usize> = [[[i8; N]; 2]; 3];

/// Where in three vectors' bytes each is read; the last two bytes are only read as those further on.
const fn starts(bytes: usize) -> [usize; 3] {
    [0, bytes, 2 * bytes - 2]
}

impl Pairs {
    /// Of the channels' weights, which fit a byte, as does the sum of those of one sign.
    pub(crate) fn new(weights: [i16; 3]) -> Self {
        Self {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            of_64: pairs(weights),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            of_32: pairs(weights),
        }
    }

    /// Sets the bit of each block in which `weights . x >= level` for a pixel x, in words that are 0; false
    /// if it cannot. A last block that is cut short counts what it lacks from the one before it.
    #[inline(always)]
    pub(crate) fn mark<S: Simd>(&self, simd: S, bytes: &[u8], level: i16, hot: &mut [u64]) -> bool {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            if let Some(wide) = simd.level().as_avx512() {
                mark(wide, bytes, &self.of_64, level, hot, |a, b| {
                    dot_64(wide, a, b)
                });
                return true;
            }
            if let Some(wide) = simd.level().as_avx2() {
                mark(wide, bytes, &self.of_32, level, hot, |a, b| {
                    dot_32(wide, a, b)
                });
                return true;
            }
        }
        let _ = (simd, bytes, level, hot);
        false
    }
}

fn pairs<const N: usize>(weights: [i16; 3]) -> Weights<N> {
    #[expect(clippy::cast_possible_truncation, reason = "they fit")]
    let [first, second, third] = weights.map(|weight| weight as i8);
    starts(N).map(|start| {
        let mut both = [[0; N]; 2];
        let [here, further] = &mut both;
        let lanes = here.as_chunks_mut().0.iter_mut();
        let lanes = lanes.zip(further.as_chunks_mut().0);
        for ((here, further), at) in lanes.zip((start..).step_by(2)) {
            (*here, *further) = match at % 6 {
                0 => ([first, second], [third, 0]),
                2 => ([0, first], [second, third]),
                _ => ([0, 0], [0, 0]),
            };
        }
        both
    })
}

#[inline(always)]
fn mark<S: Simd, const N: usize>(
    simd: S,
    bytes: &[u8],
    weights: &Weights<N>,
    level: i16,
    hot: &mut [u64],
    dot: impl Fn(S::u8s, S::i8s) -> S::i16s,
) {
    let weights = weights.map(|both| both.map(|one| S::i8s::from_slice(simd, &one)));
    let level = S::i16s::splat(simd, level);
    let reaches = |block| {
        u64::from(
            peak::<S, N>(simd, block, &weights, &dot)
                .simd_ge(level)
                .any_true(),
        )
    };
    let (blocks, rest) = bytes.as_chunks::<BYTES>();
    for (word, blocks) in hot.iter_mut().zip(blocks.chunks(64)) {
        for (bit, block) in blocks.iter().enumerate() {
            *word |= reaches(block) << bit;
        }
    }
    if !rest.is_empty()
        && let Some(last) = bytes.last_chunk()
        && let Some(word) = hot.get_mut(blocks.len() / 64)
    {
        *word |= reaches(last) << (blocks.len() % 64);
    }
}

/// By lane the largest sum of a block's pixels.
#[inline(always)]
fn peak<S: Simd, const N: usize>(
    simd: S,
    block: &[u8; BYTES],
    weights: &[[S::i8s; 2]; 3],
    dot: &impl Fn(S::u8s, S::i8s) -> S::i16s,
) -> S::i16s {
    let mut peak = S::i16s::splat(simd, i16::MIN);
    for part in block.chunks_exact(3 * N) {
        for (start, [here, further]) in starts(N).into_iter().zip(weights) {
            let load = |at: usize| S::u8s::from_slice(simd, &part[at..at + N]);
            let sum = dot(load(start), *here) + dot(load(start + 2), *further);
            peak = peak.max(sum);
        }
    }
    peak
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
mod dots {
    #[cfg(target_arch = "x86")]
    use std::arch::x86::{_mm256_maddubs_epi16, _mm512_maddubs_epi16};
    #[cfg(target_arch = "x86_64")]
    use std::arch::x86_64::{_mm256_maddubs_epi16, _mm512_maddubs_epi16};

    use fearless_simd::{
        Avx2, Avx512, i8x32, i8x64, i16x16, i16x32, kernel, prelude::*, u8x32, u8x64,
    };

    kernel!(
        #[inline(always)]
        pub(super) fn dot_64(simd: Avx512, a: u8x64<Avx512>, b: i8x64<Avx512>) -> i16x32<Avx512> {
            _mm512_maddubs_epi16(a.into(), b.into()).simd_into(simd)
        }
    );

    kernel!(
        #[inline(always)]
        pub(super) fn dot_32(simd: Avx2, a: u8x32<Avx2>, b: i8x32<Avx2>) -> i16x16<Avx2> {
            _mm256_maddubs_epi16(a.into(), b.into()).simd_into(simd)
        }
    );
}
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
use dots::{dot_32, dot_64};

/// Pixels in a vector of 32-bit sums.
const LANES: usize = 16;

/// Where in a block's bytes the pixels of each sum lie, and how far into what is read there.
const QUARTERS: [(usize, usize); 4] = [(0, 0), (48, 0), (96, 0), (BYTES - 64, 16)];

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
    let [first, second, third] = weights;
    let pair = |even: i16, odd: i16| {
        let lanes: [i16; 2 * LANES] = std::array::from_fn(|i| if i % 2 == 0 { even } else { odd });
        i16x32::from_slice(simd, &lanes)
    };
    let (here, further) = (pair(first, second), pair(third, 0));
    let offset = i32x16::splat(simd, offset);
    let zero = u8x64::splat(simd, 0);
    let blocks = bytes.as_chunks::<BYTES>().0;
    let outputs = projected.as_chunks_mut::<BLOCK>().0;
    for (block, output) in blocks.iter().zip(&mut *outputs) {
        let sums = QUARTERS.map(|(at, shift)| {
            let pixels = u8x64::from_slice(simd, &block[at..at + 64]);
            let [two, one] = PICKS[shift / 16].map(|picks| {
                let picks = u8x64::from_slice(simd, &picks);
                let lanes: i16x32<S> = pixels.concat_swizzle_dyn(zero, picks).bitcast();
                lanes
            });
            let sum = simd.pairwise_dot_product_i16x32(two, here)
                + simd.pairwise_dot_product_i16x32(one, further);
            (sum + offset) >> bits
        });
        let [a, b, c, d] = sums;
        let (left, right) = output.split_at_mut(2 * LANES);
        simd.narrow_i32x16(a, b).store_slice(left);
        simd.narrow_i32x16(c, d).store_slice(right);
    }
    blocks.len().min(outputs.len()) * BLOCK
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
        let narrower = best.as_avx2().map(|avx2| avx2.level());
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
                pixel.iter().zip(weights).map(|(x, weight)| i32::from(*x) * i32::from(weight)).sum::<i32>() as i16
            };
            let (pixels, _) = bytes.as_chunks::<3>();
            // At a sum that occurs the answer changes.
            let level = sum(&pixels[pick.index(pixels.len())]).saturating_add(above);
            let reaches = |pixels: &[[u8; 3]]| pixels.iter().any(|pixel| sum(pixel) >= level);
            let (whole, rest) = pixels.as_chunks::<BLOCK>();
            let mut expected: Vec<bool> = whole.iter().map(|block| reaches(block)).collect();
            if !rest.is_empty() {
                expected.push(reaches(&pixels[pixels.len() - BLOCK..]));
            }
            for simd in levels() {
                let mut hot = [0];
                let can = dispatch!(simd, simd => {
                    Pairs::new(weights).mark(simd, &bytes, level, &mut hot)
                });
                let marked: Vec<bool> = (0..expected.len()).map(|bit| hot[0] >> bit & 1 == 1).collect();
                prop_assert!(!can || marked == expected, "{:?}: {:?}", simd, marked);
                prop_assert!(can || hot == [0]);
            }
        }

        #[test]
        fn projects_as_pixel_by_pixel(
            bytes in prop::collection::vec(any::<u8>(), 0..3 * 3 * BLOCK),
            weights in any::<[i16; 3]>(),
            offset in -1_000_000..1_000_000,
        ) {
            for simd in levels() {
                let (pixels, _) = bytes.as_chunks::<3>();
                let mut projected = vec![0; pixels.len()];
                let done = dispatch!(simd, simd => project(simd, &bytes, weights, (offset, 9), &mut projected));
                prop_assert!(done == 0 || done == pixels.len() / BLOCK * BLOCK);
                for (pixel, value) in pixels.iter().zip(&projected[..done]) {
                    let terms = pixel.iter().zip(weights);
                    let sum: i32 = terms.map(|(x, weight)| i32::from(*x) * i32::from(weight)).sum();
                    prop_assert_eq!(*value, ((sum + offset) >> 9) as i16);
                }
            }
        }
    }
}
