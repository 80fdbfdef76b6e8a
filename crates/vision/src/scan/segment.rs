//! One pass over a frame: projection, low-pass, threshold, runs.
//!
//! Most of a frame has no pixel above the threshold, and the low-pass never exceeds its largest input. So each row is
//! first scanned coarsely and fast for blocks that may have such a pixel; only the blocks around those are active and go
//! through the exact arithmetic. The result is that of the whole frame.
//!
//! The frame is processed in strips: rows are scanned, then filtered, then passed on. Each of the three is a short
//! loop, so that branches mispredicted at runs in one do not repeat the work of the others.

use std::ops::Range;

use fearless_simd::{Level, dispatch, prelude::*};

use super::active_blocks::{ActiveBlocks, BLOCK, STRIP};
use super::discriminant::ColorDiscriminant;
use super::format::PixelFormat;
use super::frame::{Frame, Window};
use super::lowpass::{Block, LowPass, RowIndex, replicate_end};
use super::projection::{Projection, least_scan_width};
use super::row::Row;
use super::runs::{Runs, runs_of_bits};

/// Finds the runs of marker pixels in the rows of a frame, top to bottom, in memory that does not grow with the
/// frame's height.
#[derive(Clone, Debug)]
pub struct Segmenter {
    level: Level,
    discriminant: ColorDiscriminant,
    /// Projection for the format of the last frame.
    prepared: Option<(PixelFormat, Projection)>,
    active: ActiveBlocks,
    rows: Rows,
}

/// Intermediate values of a row, and the marker pixels of a strip.
#[derive(Clone, Debug)]
struct Rows {
    blocks: usize,
    passes: Vec<LowPass>,
    /// Input and output of a pass.
    values: [Vec<Block>; 2],
    /// Marker pixels, a word for each row of the strip and each block; valid in active blocks alone.
    marker: Vec<u64>,
}

impl Segmenter {
    /// With `smoothing` passes of the 3x3 binomial low-pass over the projected channel.
    pub fn new(discriminant: ColorDiscriminant, smoothing: usize) -> Self {
        Self {
            level: Level::new(),
            discriminant,
            prepared: None,
            active: ActiveBlocks::default(),
            rows: Rows {
                blocks: 0,
                passes: vec![LowPass::default(); smoothing],
                values: [const { Vec::new() }; 2],
                marker: Vec::new(),
            },
        }
    }

    /// Calls `visit(v, runs)`, top to bottom, for every row that has marker pixels and the row after it, and for some
    /// others.
    ///
    /// Allocates only when a frame is wider than those before.
    pub fn each_row(&mut self, frame: &impl Frame, visit: impl FnMut(usize, Runs<'_>)) {
        self.each_row_in(frame, Window::whole(frame), visit);
    }

    /// As [`each_row`](Self::each_row), for the part of a window inside the frame.
    ///
    /// A pixel is marker here exactly if it is in the whole frame: the low-pass reads the pixels around the window.
    pub fn each_row_in(
        &mut self,
        frame: &impl Frame,
        window: Window,
        visit: impl FnMut(usize, Runs<'_>),
    ) {
        let window = window.within(frame);
        if window.left == window.right || window.top == window.bottom {
            return;
        }
        let format = frame.format();
        let old = self.prepared.take().filter(|(same, _)| *same == format);
        let new = || (format, self.discriminant.projection(format));
        let (_, projection) = self.prepared.insert(old.unwrap_or_else(new));
        let Self { active, rows, .. } = self;
        dispatch!(self.level, simd => sweep(simd, active, rows, frame, window, projection, visit));
    }
}

/// Scans, filters and passes on the rows of a window that is not empty.
#[inline(always)]
fn sweep<S: Simd>(
    simd: S,
    active: &mut ActiveBlocks,
    rows: &mut Rows,
    frame: &impl Frame,
    window: Window,
    projection: &Projection,
    mut visit: impl FnMut(usize, Runs<'_>),
) {
    let delay = rows.passes.len();
    // The error at the border of the pixels that are read moves inwards by one pixel per pass.
    let read = window.grown(delay, frame);
    let columns = frame.format().whole_groups(read.left..read.right);
    let columns = whole_blocks(columns, frame.width());
    let (width, height) = (columns.len(), read.bottom - read.top);
    let line = |n: usize| Row::of(frame, read.top + n, columns.clone());
    // A pixel in row n changes the filtered rows n - delay to n + delay, which depend on rows n - 2 delay to
    // n + 2 delay: the scan is that far ahead.
    let reach = 2 * delay;
    active.start(width, reach);
    rows.start(width);
    // In a narrower window the scan costs more than it saves.
    let is_scanned = width >= least_scan_width(simd, frame.format());
    let mut scanned = 0;
    // Step n reads row n and gives the filtered row n - delay.
    let steps = height + delay;
    for first in (0..steps).step_by(STRIP) {
        active.next_strip();
        let ahead = height.min(first + STRIP + reach);
        for n in scanned..ahead {
            let hits = active.hits(n + reach - first);
            if is_scanned {
                projection.mark(simd, line(n), width, hits);
            } else {
                hits.fill(u64::MAX);
            }
        }
        scanned = ahead;
        let steps = first..steps.min(first + STRIP);
        if !active.activate() {
            continue;
        }
        for step in steps.clone() {
            let source = (step < height).then(|| line(step));
            let at = Step {
                source,
                index: step,
                width,
                height,
            };
            rows.filter(simd, active, step - first, at, projection);
        }
        for step in steps {
            let Some(v) = step.checked_sub(delay).map(|v| v + read.top) else {
                continue;
            };
            if (window.top..window.bottom).contains(&v) && active.is_active(step - first) {
                let (marker, active) = (rows.marker(step - first), active.active(step - first));
                let runs = Runs {
                    marker,
                    active,
                    origin: columns.start,
                    window: [window.left, window.right],
                };
                visit(v, runs);
            }
        }
    }
}

/// A step of the pass over the frame.
#[derive(Clone, Copy)]
struct Step<'a> {
    /// The row that is read, unless all of them have been.
    source: Option<Row<'a>>,
    index: usize,
    width: usize,
    height: usize,
}

impl Rows {
    fn start(&mut self, width: usize) {
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
    #[inline(always)]
    fn filter<S: Simd>(
        &mut self,
        simd: S,
        active: &ActiveBlocks,
        row: usize,
        at: Step<'_>,
        projection: &Projection,
    ) {
        for blocks in runs_of_bits(active.newly_active(row)) {
            for pass in &mut self.passes {
                pass.reset(&blocks);
            }
        }
        let mut is_active = false;
        for blocks in runs_of_bits(active.active(row).iter().copied()) {
            self.filter_blocks(simd, row, &blocks, at, projection);
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
        row: usize,
        blocks: &Range<usize>,
        Step {
            source,
            index,
            width,
            height,
        }: Step<'_>,
        projection: &Projection,
    ) {
        let columns = blocks.start * BLOCK..width.min(blocks.end * BLOCK);
        let [values, filtered] = self.values.each_mut();
        let (Some(mut values), Some(mut filtered)) = (
            values.get_mut(blocks.clone()),
            filtered.get_mut(blocks.clone()),
        ) else {
            return;
        };
        if let (Some(source), Some(values)) =
            (source, values.as_flattened_mut().get_mut(..columns.len()))
        {
            projection.project(simd, source.columns(columns.clone()), values);
        }
        for (n, pass) in (0..=index).rev().zip(&mut self.passes) {
            replicate_end(values, columns.len());
            pass.step(simd, values, filtered, blocks, RowIndex { n, height });
            (values, filtered) = (filtered, values);
        }
        let words = row * self.blocks + blocks.start..row * self.blocks + blocks.end;
        let words = self.marker.get_mut(words).unwrap_or_default();
        for (word, values) in words.iter_mut().zip(&*values) {
            *word = above(simd, values, projection.threshold());
        }
        // Bits beyond the image are no pixels.
        let beyond = words.len() * BLOCK - columns.len();
        if let Some(word) = words.last_mut() {
            *word &= u64::MAX >> beyond;
        }
    }

    /// Marker pixels of a row of the strip, by block.
    #[inline(always)]
    fn marker(&self, row: usize) -> &[u64] {
        let words = row * self.blocks..(row + 1) * self.blocks;
        self.marker.get(words).unwrap_or_default()
    }
}

/// Extends columns to whole blocks, as far as the frame has them.
fn whole_blocks(columns: Range<usize>, width: usize) -> Range<usize> {
    let wanted = columns.len().next_multiple_of(BLOCK).min(width);
    let start = columns.start.min(width - wanted);
    start..start + wanted
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
