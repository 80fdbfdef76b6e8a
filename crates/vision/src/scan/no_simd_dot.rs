//! Takes the place of `simd_dot` on processors without an instruction that multiplies bytes in pairs.

use fearless_simd::Simd;

#[derive(Clone, Debug)]
pub struct SimdDot;

impl SimdDot {
    pub fn new(_weights: [i16; 3], _level: i16) -> Self {
        Self
    }

    #[inline(always)]
    pub fn mark<S: Simd>(&self, _simd: S, _bytes: &[u8], _active: &mut [u64]) {}
}

#[inline(always)]
pub fn is_fast<S: Simd>(_simd: S) -> bool {
    false
}
