//! The blurred mask of an outline.

use super::patch::{Patch, SIDE};
use crate::math::{floor, real, single};
use crate::recognition::{Outline, SECTION_DISCS, SectionDisc};

/// Sub-rows in which the coverage of a sample is computed: its error is then below 1/8 at an edge, and blurred.
const SUB_ROWS: usize = 4;

/// Coverage of each sample by an outline, blurred.
#[derive(Clone, Debug)]
pub struct Mask {
    /// Of each sample, row by row, 0 to 1.
    pub coverage: Vec<f32>,
}

impl Default for Mask {
    fn default() -> Self {
        Self {
            coverage: Vec::with_capacity(SIDE * SIDE),
        }
    }
}

impl Mask {
    /// Computes the coverage of each sample by an outline.
    pub fn draw(&mut self, outline: &Outline, patch: &Patch) {
        self.coverage.clear();
        self.coverage.resize(patch.green.len(), 0.0);
        let columns = patch.columns.max(1);
        let part = 1.0 / real(SUB_ROWS);
        for (row, values) in self.coverage.chunks_mut(columns).enumerate() {
            for sub_row in 0..SUB_ROWS {
                let offset = (real(sub_row) + 0.5) * part - 0.5;
                let v = patch.origin[1] + (real(row) + offset) * patch.step;
                outline.each_crossing(v, |from, to| {
                    let [from, to] = [from, to].map(|u| (u - patch.origin[0]) / patch.step + 0.5);
                    let (from, to) = (from.max(0.0), to.min(real(columns)));
                    let first = floor(from);
                    for (value, left) in values.iter_mut().skip(first).zip(first..) {
                        let left = real(left);
                        if left >= to {
                            break;
                        }
                        let inside = (left + 1.0).min(to) - left.max(from);
                        *value += single(part * inside.max(0.0));
                    }
                });
            }
        }
    }

    /// Clears the samples of a band that the section hides.
    pub fn hide(
        &mut self,
        section: &[Option<SectionDisc>; SECTION_DISCS],
        band: usize,
        patch: &Patch,
    ) {
        let nearer = section.iter().flatten().filter(|disc| disc.is_nearer[band]);
        for disc in nearer {
            let square = disc.radius.powi(2);
            let [u0, v0] = disc.centre;
            let rows = self.coverage.chunks_mut(patch.columns.max(1)).enumerate();
            for (row, values) in rows {
                let v = patch.origin[1] + real(row) * patch.step - v0;
                if v * v >= square {
                    continue;
                }
                let reach = (square - v * v).sqrt();
                let [from, to] = [u0 - reach, u0 + reach]
                    .map(|u| floor((u - patch.origin[0]) / patch.step + 1.0));
                for value in values.iter_mut().take(to).skip(from) {
                    *value = 0.0;
                }
            }
        }
    }

    /// Convolves the mask with a normal density of standard deviation `sigma` (samples), cut at 3 sigma.
    pub fn blur(&mut self, sigma: f64, columns: usize, Self { coverage: buffer }: &mut Self) {
        let mut kernel = [0.0_f32; SIDE / 2];
        let reach = floor((3.0 * sigma).ceil()).clamp(1, kernel.len() - 1);
        let mut sum = 0.0;
        for (index, weight) in kernel.iter_mut().enumerate().take(reach + 1) {
            let distance = real(index) / sigma;
            *weight = single((-0.5 * distance * distance).exp());
            sum += if index == 0 { *weight } else { 2.0 * *weight };
        }
        for weight in &mut kernel {
            *weight /= sum;
        }
        buffer.clear();
        buffer.resize(self.coverage.len(), 0.0);
        let columns = columns.max(1);
        let reached =
            |at: usize, count: usize| at.saturating_sub(reach)..(at + reach + 1).min(count);
        let rows = self.coverage.chunks(columns);
        for (row, blurred) in rows.zip(buffer.chunks_mut(columns)) {
            for (u, value) in row.iter().enumerate().filter(|(_, value)| **value > 0.0) {
                for to in reached(u, row.len()) {
                    blurred[to] += kernel[u.abs_diff(to)] * value;
                }
            }
        }
        self.coverage.fill(0.0);
        let rows = buffer.len() / columns;
        for (v, row) in buffer.chunks(columns).enumerate() {
            for to in reached(v, rows) {
                let weight = kernel[v.abs_diff(to)];
                let into = self.coverage.iter_mut().skip(to * columns);
                for (target, value) in into.zip(row) {
                    *target += weight * value;
                }
            }
        }
    }
}
