//! Projection, low-pass and threshold of the rows of a strip.

use std::ops::Range;

use fearless_simd::prelude::*;

use super::active_blocks::{ActiveBlocks, BLOCK, STRIP};
use super::lowpass::{Block, LowPass, cut, replicate_end};
use super::projection::Projection;
use super::row::Row;
use super::runs::runs_of_bits;

/// Projects and filters the active blocks of rows, and keeps the marker pixels of a strip.
#[derive(Clone, Debug, Default)]
pub struct Filter {
    width: usize,
    height: usize,
    blocks: usize,
    passes: Vec<LowPass>,
    /// Input and output of a pass.
    values: [Vec<Block>; 2],
    /// Marker pixels, a word for each row of the strip and each block; valid in active blocks alone.
    marker: Vec<u64>,
}

impl Filter {
    /// With this many passes of the low-pass.
    pub fn new(passes: usize) -> Self {
        Self {
            passes: vec![LowPass::default(); passes],
            ..Self::default()
        }
    }

    pub fn passes(&self) -> usize {
        self.passes.len()
    }

    /// Starts an image; allocates only when the width grows.
    pub fn start(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.blocks = width.div_ceil(BLOCK);
        for values in &mut self.values {
            values.resize(self.blocks, [0; BLOCK]);
        }
        self.marker.resize(STRIP * self.blocks, 0);
        for pass in &mut self.passes {
            pass.prepare(self.blocks);
        }
    }

    /// Projects the active blocks of a row, filters them, with pass k being k rows behind, and applies the threshold.
    ///
    /// The steps are numbered from that of the first row; `first` is that of the strip. `source` is the row, None after the last.
    #[inline(always)]
    pub fn step<S: Simd>(
        &mut self,
        simd: S,
        active: &ActiveBlocks,
        (first, step): (usize, usize),
        source: Option<Row<'_>>,
        projection: &Projection,
    ) {
        let row = step - first;
        for blocks in runs_of_bits(active.newly_active(row)) {
            for pass in &mut self.passes {
                pass.reset(&blocks);
            }
        }
        let mut is_active = false;
        for blocks in runs_of_bits(active.active(row).iter().copied()) {
            self.filter_blocks(simd, (row, step), &blocks, source, projection);
            is_active = true;
        }
        if is_active {
            for pass in &mut self.passes {
                pass.advance();
            }
        }
    }

    #[inline(always)]
    fn filter_blocks<S: Simd>(
        &mut self,
        simd: S,
        (row, step): (usize, usize),
        blocks: &Range<usize>,
        source: Option<Row<'_>>,
        projection: &Projection,
    ) {
        let columns = blocks.start * BLOCK..self.width.min(blocks.end * BLOCK);
        let [mut values, mut filtered] = self.values.each_mut().map(|row| cut(row, blocks));
        if let (Some(source), Some(values)) =
            (source, values.as_flattened_mut().get_mut(..columns.len()))
        {
            projection.project(simd, source.columns(columns.clone()), values);
        }
        for (n, pass) in (0..=step).rev().zip(&mut self.passes) {
            replicate_end(values, columns.len());
            pass.step(simd, values, filtered, blocks, (n, self.height));
            (values, filtered) = (filtered, values);
        }
        let words = row * self.blocks + blocks.start..row * self.blocks + blocks.end;
        let words = self.marker.get_mut(words).unwrap_or_default();
        for (word, values) in words.iter_mut().zip(&*values) {
            *word = above(simd, values, projection.threshold);
        }
        // Bits beyond the image are no pixels.
        let beyond = words.len() * BLOCK - columns.len();
        if let Some(word) = words.last_mut() {
            *word &= u64::MAX >> beyond;
        }
    }

    /// Marker pixels of a row of the strip, by block.
    #[inline(always)]
    pub fn marker(&self, row: usize) -> &[u64] {
        let words = row * self.blocks..(row + 1) * self.blocks;
        self.marker.get(words).unwrap_or_default()
    }
}

/// Bit i is set if value i exceeds the threshold.
#[inline(always)]
fn above<S: Simd>(simd: S, values: &[i16; BLOCK], threshold: i16) -> u64 {
    let level = S::i16s::splat(simd, threshold);
    let lanes = S::i16s::LEN;
    let mut word = 0;
    for (vector, start) in values.chunks_exact(lanes).zip((0..).step_by(lanes)) {
        let above = S::i16s::from_slice(simd, vector).simd_gt(level);
        word |= above.to_bitmask() << start;
    }
    word
}
