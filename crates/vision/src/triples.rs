//! Pixels of three bytes, taken apart where one instruction picks bytes from two wide vectors.
//!
//! Elsewhere, and for the other formats, what the compiler makes of [`Group`](crate::format::Group) is
//! as fast.

use fearless_simd::{i16x32, prelude::*, u8x64, u16x32};

/// Pixels in three vectors.
const PIXELS: usize = 64;

/// By channel: which of two vectors' bytes are its; then where to complete them from a third.
const PICKS: [[[u8; PIXELS]; 2]; 3] = picks();

/// Whether it is worth it.
#[inline(always)]
pub(crate) fn are_quick<S: Simd>(_: S) -> bool {
    S::u8s::LEN == PIXELS
}

/// Whether `weights . x >= level` for a pixel x, and the bytes behind the last 64 whole pixels. No
/// sum may leave an `i16`.
#[inline(always)]
pub(crate) fn reach<S: Simd>(
    simd: S,
    bytes: &[u8],
    weights: [i16; 3],
    level: i16,
) -> (bool, &[u8]) {
    let (groups, rest) = bytes.as_chunks::<{ 3 * PIXELS }>();
    let [first, second, third] = weights.map(|weight| i16x32::splat(simd, weight));
    let picks = PICKS.map(|both| both.map(|indices| u8x64::from_slice(simd, &indices)));
    let low_bytes = i16x32::splat(simd, 0xff);
    let mut peak = i16x32::splat(simd, i16::MIN);
    for group in groups {
        let [x, y, z] = channels(simd, group, &picks);
        // The sum fits; a part of it may not, and comes back.
        let even = (x & low_bytes) * first + (y & low_bytes) * second + (z & low_bytes) * third;
        let odd = high_bytes(x) * first + high_bytes(y) * second + high_bytes(z) * third;
        peak = peak.max(even).max(odd);
    }
    (peak.simd_ge(i16x32::splat(simd, level)).any_true(), rest)
}

/// The channels of 64 pixels, two pixels to a lane.
#[inline(always)]
fn channels<S: Simd>(
    simd: S,
    group: &[u8; 3 * PIXELS],
    picks: &[[u8x64<S>; 2]; 3],
) -> [i16x32<S>; 3] {
    let (one, rest) = group.split_at(PIXELS);
    let (two, three) = rest.split_at(PIXELS);
    let [one, two, three] = [one, two, three].map(|bytes| u8x64::from_slice(simd, bytes));
    picks.map(|[of_two, of_third]| {
        let most = one.concat_swizzle_dyn(two, of_two);
        most.concat_swizzle_dyn(three, of_third).bitcast()
    })
}

#[inline(always)]
fn high_bytes<S: Simd>(lanes: i16x32<S>) -> i16x32<S> {
    (lanes.bitcast::<u16x32<S>>() >> 8).bitcast()
}

#[expect(clippy::cast_possible_truncation, reason = "below 128")]
const fn picks() -> [[[u8; PIXELS]; 2]; 3] {
    let mut picks = [[[0; PIXELS]; 2]; 3];
    let mut channel = 0;
    while channel < 3 {
        let mut pixel = 0;
        while pixel < PIXELS {
            let at = 3 * pixel + channel;
            if at < 2 * PIXELS {
                picks[channel][0][pixel] = at as u8;
                picks[channel][1][pixel] = pixel as u8;
            } else {
                picks[channel][1][pixel] = (at - PIXELS) as u8;
            }
            pixel += 1;
        }
        channel += 1;
    }
    picks
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn decides_as_pixel_by_pixel(
            bytes in prop::collection::vec(any::<u8>(), 0..3 * 3 * PIXELS),
            weights in [-64..64_i16, -64..64_i16, -64..64_i16],
            pick in any::<prop::sample::Index>(),
            above in 0..2_i16,
        ) {
            let (pixels, _) = bytes[..bytes.len() / (3 * PIXELS) * 3 * PIXELS].as_chunks::<3>();
            let sum = |pixel: &[u8; 3]| -> i16 {
                pixel.iter().zip(weights).map(|(x, weight)| i16::from(*x) / 2 * weight).sum()
            };
            let halves: Vec<u8> = bytes.iter().map(|byte| byte / 2).collect();
            // At the largest sum the answer changes.
            let largest = pixels.iter().map(sum).max().unwrap_or(0);
            let level = if pick.index(2) == 0 { largest + above } else { above };
            let expected = pixels.iter().any(|pixel| sum(pixel) >= level);
            for simd in [Level::new(), Level::baseline()] {
                let (found, rest) = dispatch!(simd, simd => {
                    let (found, rest) = reach(simd, &halves, weights, level);
                    (found, rest.len())
                });
                prop_assert_eq!(found, expected);
                prop_assert_eq!(rest, bytes.len() % (3 * PIXELS));
            }
        }
    }
}
