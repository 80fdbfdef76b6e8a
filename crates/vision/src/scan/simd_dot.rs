//! Weighted sums of pixels of three bytes, compared with a level, by an instruction that multiplies bytes in pairs.
//!
//! On other processors, and for the other formats, the compiler's vectorisation of [`Group`](super::row::Group) is as fast.

use fearless_simd::prelude::*;

use super::active_blocks::BYTES;
use super::byte_dot::ByteDot;

/// Finds the blocks in which a weighted sum of a pixel's three bytes reaches a level.
///
/// The bytes are multiplied where they lie, in vectors of 64 or 32 bytes. The sums of pixels 2 k and 2 k + 1, bytes
/// 6 k to 6 k + 5, appear at bytes 6 k and 6 k + 2: each is that of the pair there plus that of the pair two bytes on.
/// The sum at 6 k + 4 belongs to no pixel and is 0.
#[derive(Clone, Debug)]
pub struct SimdDot {
    /// Weights of the bytes of a vector and of those of the vector two bytes on, from each of six bytes on.
    weights: [[i8; 64 + 6]; 2],
    level: i16,
    /// Index of each byte of the vector that starts two bytes on, in this vector and the next. A field, because
    /// with a constant the compiler takes two permutations instead of one.
    two_on: [u8; 64],
}

impl SimdDot {
    /// Takes weights that fit a byte; 255 times the sum of those of one sign must be below `i16::MAX`.
    pub fn new(weights: [i16; 3], level: i16) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "weights fit a byte")]
        let [first, second, third] = weights.map(|weight| weight as i8);
        let six = [
            [first, second, 0, first, 0, 0],
            [third, 0, second, third, 0, 0],
        ];
        Self {
            weights: six.map(|six| std::array::from_fn(|index| six[index % 6])),
            level,
            two_on: std::array::from_fn(|index| index.to_le_bytes()[0] + 2),
        }
    }

    /// Sets the bit of each block in which `weights . x >= level` for a pixel x, or of every block if black
    /// reaches the level. The words must be 0. A shorter last block is extended by pixels of the one before.
    ///
    /// Does nothing on a processor where it [is not fast](is_fast).
    #[inline(always)]
    pub fn mark<S: Simd>(&self, simd: S, bytes: &[u8], active: &mut [u64]) {
        if let Some(wide) = simd.level().as_avx512() {
            mark(wide, bytes, self, active);
        } else if let Some(wide) = simd.level().as_avx2() {
            mark(wide, bytes, self, active);
        }
    }
}

/// Whether this processor has the instruction for [`SimdDot::mark`].
#[inline(always)]
pub fn is_fast<S: Simd>(simd: S) -> bool {
    simd.level().as_avx2().is_some()
}

#[inline(always)]
fn mark<S: ByteDot>(simd: S, bytes: &[u8], dot: &SimdDot, active: &mut [u64]) {
    let registers = Registers::new(simd, dot);
    let (blocks, rest) = bytes.as_chunks::<BYTES>();
    for (word, blocks) in active.iter_mut().zip(blocks.chunks(64)) {
        let mut bits = 0;
        for (bit, block) in blocks.iter().enumerate() {
            bits |= u64::from(registers.is_reached(simd, block)) << bit;
        }
        *word = bits;
    }
    if !rest.is_empty()
        && let Some(last) = bytes.last_chunk()
        && let Some(word) = active.get_mut(blocks.len() / 64)
    {
        *word |= u64::from(registers.is_reached(simd, last)) << (blocks.len() % 64);
    }
}

/// Weights and level, loaded once per row: left in memory, they would be loaded more often than the bytes.
struct Registers<S: Simd> {
    weights: [[S::i8s; 2]; 3],
    level: S::i16s,
    two_on: S::u8s,
}

impl<S: ByteDot> Registers<S> {
    #[inline(always)]
    fn new(simd: S, dot: &SimdDot) -> Self {
        Self {
            weights: [load(simd, dot, 0), load(simd, dot, 1), load(simd, dot, 2)],
            level: S::i16s::splat(simd, dot.level),
            two_on: S::u8s::from_slice(simd, &dot.two_on[..S::u8s::LEN]),
        }
    }

    /// Whether a pixel of a block reaches the level.
    #[inline(always)]
    fn is_reached(&self, simd: S, block: &[u8; BYTES]) -> bool {
        let lanes = S::u8s::LEN;
        let mut largest = S::i16s::splat(simd, i16::MIN);
        let zero = S::u8s::splat(simd, 0);
        for part in block.chunks_exact(3 * lanes) {
            let first = S::u8s::from_slice(simd, &part[..lanes]);
            let second = S::u8s::from_slice(simd, &part[lanes..2 * lanes]);
            let third = S::u8s::from_slice(simd, &part[2 * lanes..]);
            // No pixel of these extends beyond the third vector.
            let vectors = [(first, second), (second, third), (third, zero)];
            for ((bytes, next), [here, two_on]) in vectors.into_iter().zip(self.weights) {
                let sum = simd.dot(bytes, here);
                let bytes = simd.two_on(bytes, next, self.two_on);
                largest = largest.max(sum + simd.dot(bytes, two_on));
            }
        }
        largest.simd_ge(self.level).any_true()
    }
}

/// Weights of one of three consecutive vectors.
#[inline(always)]
fn load<S: ByteDot>(simd: S, dot: &SimdDot, vector: usize) -> [S::i8s; 2] {
    let start = vector * S::i8s::LEN % 6;
    let [here, two_on] = &dot.weights;
    [
        S::i8s::from_slice(simd, &here[start..start + S::i8s::LEN]),
        S::i8s::from_slice(simd, &two_on[start..start + S::i8s::LEN]),
    ]
}
