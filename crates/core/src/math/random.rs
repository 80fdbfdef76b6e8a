//! Seeded random numbers.

/// Generator of normally distributed numbers: `SplitMix64` (Steele, Lea, Flood, OOPSLA 2014), four 16-bit uniform numbers
/// summed.
///
/// Mean 0, variance 1, |z| <= 3.5. The same seed gives the same numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Normal(u64);

impl Normal {
    /// A generator with a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number.
    #[expect(clippy::cast_precision_loss, reason = "the sum has 18 bits")]
    pub fn draw(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let z = z ^ (z >> 31);
        let sum = (z & 0xffff) + ((z >> 16) & 0xffff) + ((z >> 32) & 0xffff) + (z >> 48);
        // Four uniform numbers on [0, 1] have the mean 2 and the variance 1/3.
        (sum as f64 / 65_535.0 - 2.0) * 1.732_050_807_568_877_2
    }
}
