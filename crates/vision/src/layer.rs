//! An outline as light: its share of each sample, blurred.

use crate::Outline;
use crate::numbers::{real, single, whole};
use crate::patch::{Patch, SIDE};

/// Sub-rows in which an outline's share of a sample is counted.
const FINE: usize = 4;

/// A band's blurred share of each sample.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Row by row.
    pub share: Vec<f32>,
}

impl Default for Layer {
    fn default() -> Self {
        Self {
            share: Vec::with_capacity(SIDE * SIDE),
        }
    }
}

impl Layer {
    /// The outline's share of each sample.
    pub fn draw(&mut self, outline: &Outline, patch: &Patch) {
        self.share.clear();
        self.share.resize(patch.green.len(), 0.0);
        let columns = patch.columns.max(1);
        let part = 1.0 / real(FINE);
        for (row, shares) in self.share.chunks_mut(columns).enumerate() {
            for fine in 0..FINE {
                let offset = (real(fine) + 0.5) * part - 0.5;
                let v = patch.origin[1] + (real(row) + offset) * patch.step;
                outline.each_crossing(v, |from, to| {
                    let [from, to] = [from, to].map(|u| (u - patch.origin[0]) / patch.step + 0.5);
                    let (from, to) = (from.max(0.0), to.min(real(columns)));
                    let first = whole(from);
                    for (share, left) in shares.iter_mut().skip(first).zip(first..) {
                        let left = real(left);
                        if left >= to {
                            break;
                        }
                        let inside = (left + 1.0).min(to) - left.max(from);
                        *share += single(part * inside.max(0.0));
                    }
                });
            }
        }
    }

    /// Blurs by a normal density of this spread (samples).
    pub fn blur(&mut self, spread: f64, columns: usize, across: &mut Vec<f32>) {
        let mut kernel = [0.0_f32; SIDE / 2];
        let reach = whole((3.0 * spread).ceil()).clamp(1, kernel.len() - 1);
        let mut sum = 0.0;
        for (index, weight) in kernel.iter_mut().enumerate().take(reach + 1) {
            let distance = real(index) / spread;
            *weight = single((-0.5 * distance * distance).exp());
            sum += if index == 0 { *weight } else { 2.0 * *weight };
        }
        for weight in &mut kernel {
            *weight /= sum;
        }
        across.clear();
        across.resize(self.share.len(), 0.0);
        for (row, blurred) in self
            .share
            .chunks(columns.max(1))
            .zip(across.chunks_mut(columns.max(1)))
        {
            for (u, value) in row.iter().enumerate().filter(|(_, value)| **value > 0.0) {
                for (index, weight) in kernel.iter().enumerate().take(reach + 1) {
                    if let Some(place) = blurred.get_mut(u + index) {
                        *place += weight * value;
                    }
                    if index > 0
                        && let Some(place) = u.checked_sub(index).and_then(|u| blurred.get_mut(u))
                    {
                        *place += weight * value;
                    }
                }
            }
        }
        self.share.fill(0.0);
        let rows = across.len() / columns.max(1);
        for (v, row) in across.chunks(columns.max(1)).enumerate() {
            for to in v.saturating_sub(reach)..(v + reach + 1).min(rows) {
                let weight = kernel[v.abs_diff(to)];
                let into = self.share.iter_mut().skip(to * columns);
                for (place, value) in into.zip(row) {
                    *place += weight * value;
                }
            }
        }
    }
}
