use crate::Error;
use crate::error::checked;

/// Number of stored samples; a power of two, and more than two rows of 8192 pixels.
const SAMPLES: usize = 1 << 16;

/// Gaussian noise in whole grey levels, reproducible by seed and image number.
///
/// Independent samples are drawn once and stored. Each row of an image reads them from an offset that is a
/// counter-based hash of seed, image and row, so no image depends on an earlier one.
pub(crate) struct Noise {
    /// The samples twice, so that a row never has to wrap around.
    samples: Vec<i16>,
    seed: u64,
}

impl Noise {
    /// Noise whose standard deviation is `sigma` (grey levels) after rounding to whole levels.
    pub(crate) fn new(sigma: f64, seed: u64) -> Result<Self, Error> {
        checked("twin.image_noise", sigma, "a number from 0 to 255", |v| {
            (0.0..=255.0).contains(&v)
        })?;
        let normal: Vec<f64> = (0..SAMPLES as u64 / 2)
            .flat_map(|i| gaussian_pair(mix(seed, u64::MAX, i)))
            .collect();
        let rounded = |scale: f64| normal.iter().map(move |v| (v * scale).round());
        // Rounding changes the standard deviation: find the scale before rounding by bisection.
        let (mut low, mut high) = (0.0, sigma + 1.0);
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            let power = rounded(middle).map(|v| v * v).sum::<f64>() / SAMPLES as f64;
            if power < sigma * sigma {
                low = middle;
            } else {
                high = middle;
            }
        }
        let once: Vec<i16> = rounded(low).map(|v| v as i16).collect();
        Ok(Self {
            samples: once.repeat(2),
            seed,
        })
    }

    /// Adds the noise of one row, saturating at 0 and 255.
    pub(crate) fn add(&self, image: u64, row: u64, values: &mut [u8]) {
        let from = mix(self.seed, image, row) as usize % SAMPLES;
        for (value, noise) in values.iter_mut().zip(self.samples.iter().skip(from)) {
            *value = (i16::from(*value) + noise).clamp(0, 255) as u8;
        }
    }
}

/// A hash of three counters: `SplitMix64`'s finaliser over each in turn.
fn mix(seed: u64, a: u64, b: u64) -> u64 {
    [a, b].into_iter().fold(finalise(seed), |state, word| {
        finalise(state ^ word.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    })
}

fn finalise(word: u64) -> u64 {
    let mut z = word.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Two independent standard normal numbers from 64 random bits, by Box and Muller.
fn gaussian_pair(bits: u64) -> [f64; 2] {
    let unit = |half: u64| (half as f64 + 0.5) / 4_294_967_296.0;
    let radius = (-2.0 * unit(bits >> 32).ln()).sqrt();
    let (sin, cos) = (core::f64::consts::TAU * unit(bits & 0xffff_ffff)).sin_cos();
    [radius * cos, radius * sin]
}
