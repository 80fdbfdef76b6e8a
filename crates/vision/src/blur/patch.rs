//! A part of a frame as samples of how green it is, with the tissue's colour removed.

use std::ops::Range;

use crate::math::{floor, real, single};
use crate::recognition::Outline;
use crate::scan::{Affine, Frame, Row};

/// Largest number of samples in a row and in a column: larger patches are sampled more coarsely.
pub const SIDE: usize = 64;

/// Weights of B, G, R for green minus red and green minus blue, which are 0 for grey of any brightness.
const DIFFERENCES: [[f64; 3]; 2] = [[0.0, 1.0, -1.0], [-1.0, 1.0, 0.0]];

/// Histogram of second differences: bins, and width of a bin (grey levels); the median is inside for sensor noise of up
/// to 38 grey levels.
const BINS: usize = 128;
const BIN: f64 = 0.5;

/// Samples of a frame in a grid.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Coordinates of the first sample (px).
    pub origin: [f64; 2],
    /// Distance between neighbours (px).
    pub step: f64,
    /// Samples in a row.
    pub columns: usize,
    differences: Vec<[f32; 2]>,
    /// How green each sample is, row by row (grey levels).
    pub green: Vec<f32>,
}

impl Default for Patch {
    fn default() -> Self {
        Self {
            origin: [0.0; 2],
            step: 1.0,
            columns: 0,
            differences: Vec::with_capacity(SIDE * SIDE),
            green: Vec::with_capacity(SIDE * SIDE),
        }
    }
}

impl Patch {
    /// Samples columns and rows of a frame, as densely as there is room for, and at most every `least_step` pixels. A
    /// sample is the mean of its pixels. Does not allocate.
    pub fn read(
        &mut self,
        frame: &impl Frame,
        columns: Range<usize>,
        rows: Range<usize>,
        least_step: usize,
    ) {
        let step = columns.len().max(rows.len()).div_ceil(SIDE).max(least_step);
        let centre = (real(step) - 1.0) / 2.0;
        self.origin = [columns.start, rows.start].map(|first| real(first) + centre);
        self.step = real(step);
        self.columns = columns.len() / step;
        let columns = columns.start..columns.start + self.columns * step;
        let count = self.columns * (rows.len() / step);
        self.differences.clear();
        self.differences.resize(count, [0.0; 2]);
        let share = 1.0 / (self.step * self.step);
        let channels =
            DIFFERENCES.map(|weights| Affine::new(weights.map(|w| share * w), frame.format()));
        let means = self.differences.chunks_mut(self.columns.max(1));
        for (row, into) in means.enumerate() {
            for v in (0..step).map(|offset| rows.start + row * step + offset) {
                let pixels = Row::of(frame, v);
                for (u, sums) in (columns.clone()).step_by(step).zip(&mut *into) {
                    for u in u..u + step {
                        let pixel = pixels.pixel(u);
                        for (sum, channel) in sums.iter_mut().zip(&channels) {
                            *sum += single(channel.of(pixel));
                        }
                    }
                }
            }
        }
    }

    /// Removes the tissue's colour.
    ///
    /// A blurred pixel is a mixture of band, tissue, and grey or black plastic. In grey the differences of channels are
    /// 0, in tissue they have a fixed ratio k, which is fitted to samples that are redder than green outside `outlines`:
    ///
    /// ```text
    /// green = (G - B) - k (G - R),    k = sum (G - B) (G - R) / sum (G - R)^2
    /// ```
    ///
    /// It is 0 for both and for all their mixtures, and so proportional to the share of the band.
    ///
    /// Wrong when the tissue has two colours.
    pub fn remove_tissue_colour(&mut self, outlines: &[Outline; 2]) {
        let (mut square, mut product) = (0.0, 0.0);
        for (index, [red, blue]) in self.differences.iter().enumerate() {
            let at = self.coordinates(index);
            if *red < 0.0 && !outlines.iter().any(|outline| outline.contains(at)) {
                square += f64::from(red * red);
                product += f64::from(red * blue);
            }
        }
        let k = single(product / f64::max(square, 1.0));
        self.green.clear();
        let values = self.differences.iter().map(|[red, blue]| blue - k * red);
        self.green.extend(values);
    }

    /// How much redder than green a sample is (grey levels).
    pub fn redness(&self, index: usize) -> f64 {
        (-self.green_minus_red(index)).max(0.0)
    }

    fn green_minus_red(&self, index: usize) -> f64 {
        let difference = self.differences.get(index);
        difference.map_or(0.0, |[red, _]| f64::from(*red))
    }

    /// Derivatives of a sample's green by changes in the tissue's colour: in the whole patch, along u, along v, and with
    /// its brightness. Scaled to about 1 for typical samples, so that the normal equations are well conditioned.
    pub fn tissue(&self, index: usize) -> [f64; 4] {
        let red = self.green_minus_red(index) / 100.0;
        let [u, v] = self.coordinates(index);
        let [u, v] = [u - self.origin[0], v - self.origin[1]].map(|offset| offset / 30.0 - 1.0);
        [red, red * u, red * v, red * red]
    }

    /// Variance of the sensor noise (grey levels squared), from the median of second differences: gradual changes have
    /// none, and edges are few.
    pub fn sensor_variance(&self) -> f64 {
        let mut counts = [0_u32; BINS];
        let rows = self.green.chunks_exact(self.columns.max(1));
        for three in rows.flat_map(|row| row.windows(3)) {
            if let [a, b, c] = three {
                let bin = floor(f64::from((a - 2.0 * b + c).abs()) / BIN);
                if let Some(count) = counts.get_mut(bin.min(BINS - 1)) {
                    *count += 1;
                }
            }
        }
        let half = counts.iter().sum::<u32>() / 2;
        let mut below = 0;
        let bin = counts.iter().position(|count| {
            below += count;
            below > half
        });
        // The median of |x| is 0.6745 standard deviations; the variance of a second difference is 6 times that of a sample.
        let median = (real(bin.unwrap_or_default()) + 0.5) * BIN;
        (median / 0.6745).powi(2) / 6.0
    }

    /// Coordinates of a sample (px).
    pub fn coordinates(&self, index: usize) -> [f64; 2] {
        let columns = self.columns.max(1);
        let [u, v] = [index % columns, index / columns].map(real);
        [
            self.origin[0] + u * self.step,
            self.origin[1] + v * self.step,
        ]
    }
}

#[cfg(test)]
#[path = "../../tests/units/patch.rs"]
mod tests;
