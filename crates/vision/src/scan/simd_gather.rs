//! Projection of pixels of three bytes by byte permutations of 64-byte vectors.
//!
//! On other processors, and for the other formats, the compiler's vectorisation of [`Group`](super::row::Group) is as fast.

use fearless_simd::{i16x32, i32x16, prelude::*, u8x64};

use super::active_blocks::{BLOCK, BYTES};

/// Pixels in a vector of 32-bit sums.
const LANES: usize = 16;

/// Permutations that widen the first and second byte of each pixel, then its third, to 16 bits; an index of 64 gives 0.
const PERMUTATIONS: [[[u8; 64]; 2]; 2] = [permutations(0), permutations(16)];

/// Computes `(weights . x + offset) >> bits` of the pixels x of whole blocks; returns the number of these pixels.
#[inline(always)]
pub fn project<S: Simd>(
    simd: S,
    bytes: &[u8],
    weights: [i16; 3],
    (offset, bits): (i32, u32),
    projected: &mut [i16],
) -> usize {
    if S::u8s::LEN != 64 {
        return 0;
    }
    // Two weights per lane of 32 bits, the first in the lower half; the third is paired with a zero.
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

/// Weighted sums of a quarter of a block, from the `pair` of weights of the first two channels and the `third` weight.
#[inline(always)]
fn sums<S: Simd>(
    simd: S,
    block: &[u8; BYTES],
    quarter: usize,
    (pair, third, offset): (i16x32<S>, i16x32<S>, i32x16<S>),
) -> i32x16<S> {
    // The last quarter is read from farther left, so as not to read beyond the block.
    let start = (quarter * 3 * LANES).min(BYTES - 64);
    let [two, one] = &PERMUTATIONS[usize::from(quarter == 3)];
    let pixels = u8x64::from_slice(simd, &block[start..start + 64]);
    let zero = u8x64::splat(simd, 0);
    let two = pixels.concat_swizzle_dyn(zero, u8x64::from_slice(simd, two));
    let one = pixels.concat_swizzle_dyn(zero, u8x64::from_slice(simd, one));
    simd.pairwise_dot_product_i16x32(two.bitcast(), pair)
        + simd.pairwise_dot_product_i16x32(one.bitcast(), third)
        + offset
}

#[expect(clippy::cast_possible_truncation, reason = "below 65")]
const fn permutations(shift: usize) -> [[u8; 64]; 2] {
    let mut indices = [[64; 64]; 2];
    let mut pixel = 0;
    while pixel < LANES {
        let at = shift + 3 * pixel;
        indices[0][4 * pixel] = at as u8;
        indices[0][4 * pixel + 2] = at as u8 + 1;
        indices[1][4 * pixel] = at as u8 + 2;
        pixel += 1;
    }
    indices
}
