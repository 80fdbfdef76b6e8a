//! Products of bytes, summed in pairs: an instruction that portable vectors do not have.

#[cfg(target_arch = "x86")]
use std::arch::x86::{_mm256_maddubs_epi16, _mm512_maddubs_epi16};
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{_mm256_maddubs_epi16, _mm512_maddubs_epi16};

use fearless_simd::{Avx2, Avx512, i8x32, i8x64, i16x16, i16x32, kernel, prelude::*, u8x32, u8x64};

/// Vectors of bytes that can be multiplied in pairs.
pub trait ByteDot: Simd {
    /// Bytes times weights, summed in pairs; no sum may leave an `i16`.
    fn dot(self, bytes: Self::u8s, weights: Self::i8s) -> Self::i16s;

    /// The vector that starts at the third byte and ends with the first two of the `next` one; `indices` are those
    /// of its bytes in both.
    fn two_on(self, bytes: Self::u8s, next: Self::u8s, indices: Self::u8s) -> Self::u8s;
}

impl ByteDot for Avx512 {
    #[inline(always)]
    fn dot(self, bytes: u8x64<Self>, weights: i8x64<Self>) -> i16x32<Self> {
        dot_64(self, bytes, weights)
    }

    #[inline(always)]
    fn two_on(self, bytes: u8x64<Self>, next: u8x64<Self>, indices: u8x64<Self>) -> u8x64<Self> {
        bytes.concat_swizzle_dyn(next, indices)
    }
}

impl ByteDot for Avx2 {
    #[inline(always)]
    fn dot(self, bytes: u8x32<Self>, weights: i8x32<Self>) -> i16x16<Self> {
        dot_32(self, bytes, weights)
    }

    #[inline(always)]
    fn two_on(self, bytes: u8x32<Self>, next: u8x32<Self>, _: u8x32<Self>) -> u8x32<Self> {
        bytes.slide::<2>(next)
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
