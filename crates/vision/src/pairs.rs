//! Pixels of three bytes held against a level, where vectors can multiply bytes in pairs.
//!
//! Elsewhere, and for the other formats, what the compiler makes of [`Group`](crate::format::Group) is
//! as fast.

#[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
use fearless_simd::Simd;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
use fearless_simd::prelude::*;

use crate::columns::BLOCK;
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
use crate::dot::Dot;

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
    /// Where each byte of the vector two further on is, counted through the one here and the one after it. In
    /// memory, because of a constant the compiler would make two steps in the place of one.
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    places: [u8; 64],
}

/// The weights of the bytes of one of three vectors that cover 3 N bytes, and of those two further on.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
type Vector<const N: usize> = [[i8; N]; 2];

impl Pairs {
    /// Of the channels' weights, which fit a byte; 255 times the sum of those of one sign is below `i16::MAX`.
    pub(crate) fn new(weights: [i16; 3], level: i16) -> Self {
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        let _ = (weights, level);
        Self {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            of_64: [0, 64, 128].map(|start| vector(start, weights)),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            of_32: [0, 32, 64].map(|start| vector(start, weights)),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            level,
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            places: places(),
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
            mark(wide, bytes, (&self.of_64, self.level), &self.places, hot);
        } else if let Some(wide) = simd.level().as_avx2() {
            mark(wide, bytes, (&self.of_32, self.level), &self.places, hot);
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
fn places() -> [u8; 64] {
    let mut places = [0; 64];
    for (place, further) in places.iter_mut().zip(2..) {
        *place = further;
    }
    places
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
#[inline(always)]
fn mark<S: Dot, const N: usize>(
    simd: S,
    bytes: &[u8],
    (vectors, level): (&[Vector<N>; 3], i16),
    places: &[u8; 64],
    hot: &mut [u64],
) {
    let loaded = Loaded::new(simd, vectors, level, places);
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
    places: S::u8s,
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
impl<S: Dot> Loaded<S> {
    #[inline(always)]
    fn new<const N: usize>(
        simd: S,
        [a, b, c]: &[Vector<N>; 3],
        level: i16,
        places: &[u8; 64],
    ) -> Self {
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
            places: S::u8s::from_slice(simd, &places[..N]),
        }
    }

    /// Whether a pixel of a block does.
    #[inline(always)]
    fn is_reached<const N: usize>(&self, simd: S, block: &[u8; BYTES]) -> bool {
        let mut most = S::i16s::splat(simd, i16::MIN);
        let zero = S::u8s::splat(simd, 0);
        for part in block.chunks_exact(3 * N) {
            let first = S::u8s::from_slice(simd, &part[..N]);
            let second = S::u8s::from_slice(simd, &part[N..2 * N]);
            let third = S::u8s::from_slice(simd, &part[2 * N..]);
            // Beyond the third is nothing of its pixels.
            let vectors = [(first, second), (second, third), (third, zero)];
            for ((bytes, after), [here, further]) in vectors.into_iter().zip(self.weights) {
                let sum = simd.dot(bytes, here);
                let two_on = simd.two_on(bytes, after, self.places);
                most = most.max(sum + simd.dot(two_on, further));
            }
        }
        most.simd_ge(self.least).any_true()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use proptest::prelude::*;

    /// The best level there is, the one below it that multiplies in pairs, and the least.
    pub(crate) fn levels() -> Vec<Level> {
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

    #[test]
    fn each_pixel_of_a_block_counts_alone() {
        for pixel in 0..BLOCK {
            let mut bytes = [0_u8; BYTES];
            bytes[3 * pixel..3 * pixel + 3].copy_from_slice(&[10, 200, 30]);
            let sum = -2 * 10 + 3 * 200 + 30;
            for (simd, above) in levels().into_iter().flat_map(|simd| [(simd, 0), (simd, 1)]) {
                let mut hot = [0];
                let can = dispatch!(simd, simd => {
                    Pairs::new([-2, 3, 1], sum + above).mark(simd, &bytes, &mut hot);
                    are_quick(simd)
                });
                assert_eq!(hot[0] == 1, can && above == 0, "{simd:?}, {pixel}");
            }
        }
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
    }
}
