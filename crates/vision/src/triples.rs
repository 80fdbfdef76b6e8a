//! Pixels of three bytes projected, where vectors can be told to pick among bytes.
//!
//! Elsewhere, and for the other formats, what the compiler makes of [`Group`](crate::format::Group) is
//! as fast.

use fearless_simd::{i16x32, i32x16, prelude::*, u8x64};

use crate::columns::BLOCK;

/// Bytes of a block of pixels.
const BYTES: usize = 3 * BLOCK;

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
    use crate::pairs::tests::levels;
    use fearless_simd::dispatch;
    use proptest::prelude::*;

    proptest! {
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
