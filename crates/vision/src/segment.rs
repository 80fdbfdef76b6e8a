//! One pass over a frame: project, low-pass, threshold, runs.
//!
//! Most of a frame holds no pixel above the threshold, and the low-pass never exceeds its largest
//! input: only around pixels that exceed the threshold by themselves does it have to be computed.
//! So each row is first scanned, coarsely and quickly, for blocks in which there may be one; rows
//! and columns around those go through the exact arithmetic. What comes out is what would come out
//! if all of the frame did.
//!
//! That is done strip by strip: some rows are scanned, then worked, then handed over. Each of the three
//! is short and always does the same; where a processor guesses wrong in one, which happens at runs, it does
//! not have to do the others again.

use std::ops::Range;

use fearless_simd::{Level, dispatch, prelude::*};

use crate::columns::{BLOCK, Columns, STRIP};
use crate::format::Row;
use crate::lowpass::{At, Block, LowPass, repeat_end};
use crate::projection::{Projection, worth_a_look};
use crate::runs::{Runs, runs_of_bits};
use crate::{ColorDiscriminant, Frame, PixelFormat, Window};

/// Gives the rows of a frame as marker or not, top to bottom, in memory that does not grow with the
/// image's height.
#[derive(Clone, Debug)]
pub struct Segmenter {
    level: Level,
    discriminant: ColorDiscriminant,
    /// For the format of the last frame.
    prepared: Option<(PixelFormat, Projection)>,
    columns: Columns,
    rows: Rows,
}

/// What becomes of a row on its way.
#[derive(Clone, Debug)]
struct Rows {
    blocks: usize,
    passes: Vec<LowPass>,
    /// What goes into a pass and what comes out.
    values: [Vec<Block>; 2],
    /// By row of the strip and by block, a bit for each pixel: which are marker; kept up in the blocks that
    /// are worked alone.
    marker: Vec<u64>,
}

impl Segmenter {
    /// With so many passes of the 3x3 binomial low-pass over the projected channel, 0 (none) to 8.
    pub fn new(discriminant: ColorDiscriminant, smoothing: usize) -> Self {
        Self {
            level: Level::new(),
            discriminant,
            prepared: None,
            columns: Columns::default(),
            rows: Rows {
                blocks: 0,
                passes: vec![LowPass::default(); smoothing],
                values: [const { Vec::new() }; 2],
                marker: Vec::new(),
            },
        }
    }

    /// Calls `visit(v, runs)` top to bottom for every row that has marker pixels, and some others, among them
    /// the next; `runs` calls back with `start..end` of each run of marker pixels, left to right.
    ///
    /// Allocates only when a frame is wider than those before.
    pub fn each_row(&mut self, frame: &impl Frame, visit: impl FnMut(usize, Runs<'_>)) {
        self.each_row_in(frame, Window::whole(frame), visit);
    }

    /// As [`each_row`](Self::each_row), for the rows and columns of a window alone; what of it lies outside
    /// the frame is left out.
    ///
    /// A pixel is marker here exactly if it is in the whole frame: the low-pass reads the pixels
    /// around the window.
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
        let Self { columns, rows, .. } = self;
        dispatch!(self.level, simd => sweep(simd, columns, rows, frame, window, projection, visit));
    }
}

/// Takes the rows of a window that is not empty through the scan and the filters.
#[inline(always)]
fn sweep<S: Simd>(
    simd: S,
    seen: &mut Columns,
    rows: &mut Rows,
    frame: &impl Frame,
    window: Window,
    projection: &Projection,
    mut visit: impl FnMut(usize, Runs<'_>),
) {
    let delay = rows.passes.len();
    // What is wrong at the edge of what is read comes one pixel farther in with each pass.
    let read = window.grown(delay, frame);
    let columns = frame.format().whole_groups(read.left..read.right);
    let columns = whole_blocks(columns, frame.width());
    let (width, height) = (columns.len(), read.bottom - read.top);
    let line = |n: usize| Row::of(frame, read.top + n, columns.clone());
    // A pixel seen in row n matters to the filtered rows n - delay to n + delay, and these need the
    // rows from n - 2 delay to n + 2 delay: scanning goes so far ahead.
    let reach = 2 * delay;
    seen.start(width, reach);
    rows.start(width);
    // In a window so narrow, looking first would cost more than it spares.
    let looks = width >= worth_a_look(simd, frame.format());
    let mut scanned = 0;
    // In step n row n comes in, and the filtered row n - delay comes out.
    let steps = height + delay;
    for first in (0..steps).step_by(STRIP) {
        seen.next_strip();
        let ahead = height.min(first + STRIP + reach);
        for n in scanned..ahead {
            let hot = seen.seen(n + reach - first);
            if looks {
                projection.mark(simd, line(n), width, hot);
            } else {
                hot.fill(u64::MAX);
            }
        }
        scanned = ahead;
        let steps = first..steps.min(first + STRIP);
        if !seen.find_worked() {
            continue;
        }
        for step in steps.clone() {
            let source = (step < height).then(|| line(step));
            let place = Place {
                source,
                step,
                width,
                height,
            };
            rows.filter(simd, seen, step - first, place, projection);
        }
        for step in steps {
            let Some(v) = step.checked_sub(delay).map(|v| v + read.top) else {
                continue;
            };
            if (window.top..window.bottom).contains(&v) && seen.matters(step - first) {
                let (marker, worked) = (rows.marker(step - first), seen.worked(step - first));
                let within = [window.left, window.right];
                visit(v, Runs::new(marker, worked, columns.start, within));
            }
        }
    }
}

/// Where the pass over the frame is.
#[derive(Clone, Copy)]
struct Place<'a> {
    /// The row that comes in, unless all of them have.
    source: Option<Row<'a>>,
    step: usize,
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

    /// Projects a row where it matters, takes it through the low-passes, of which pass k is k rows
    /// behind, and holds what comes out against the threshold.
    #[inline(always)]
    fn filter<S: Simd>(
        &mut self,
        simd: S,
        seen: &Columns,
        row: usize,
        place: Place<'_>,
        projection: &Projection,
    ) {
        for blocks in runs_of_bits(seen.fresh(row)) {
            for pass in &mut self.passes {
                pass.forget(&blocks);
            }
        }
        let mut worked = false;
        for blocks in runs_of_bits(seen.worked(row).iter().copied()) {
            self.filter_blocks(simd, row, &blocks, place, projection);
            worked = true;
        }
        if worked {
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
        Place {
            source,
            step,
            width,
            height,
        }: Place<'_>,
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
        for (n, pass) in (0..=step).rev().zip(&mut self.passes) {
            repeat_end(values, columns.len());
            pass.step(simd, values, filtered, blocks, At { n, height });
            (values, filtered) = (filtered, values);
        }
        let words = row * self.blocks + blocks.start..row * self.blocks + blocks.end;
        let words = self.marker.get_mut(words).unwrap_or_default();
        for (word, values) in words.iter_mut().zip(&*values) {
            *word = above(simd, values, projection.threshold());
        }
        // What lies beyond the image is no pixel.
        let beyond = words.len() * BLOCK - columns.len();
        if let Some(word) = words.last_mut() {
            *word &= u64::MAX >> beyond;
        }
    }

    /// The marker pixels of a row of the strip, by block.
    #[inline(always)]
    fn marker(&self, row: usize) -> &[u64] {
        let words = row * self.blocks..(row + 1) * self.blocks;
        self.marker.get(words).unwrap_or_default()
    }
}

/// These columns and as many more as make whole blocks, if the frame has them.
fn whole_blocks(columns: Range<usize>, width: usize) -> Range<usize> {
    let wanted = columns.len().next_multiple_of(BLOCK).min(width);
    let start = columns.start.min(width - wanted);
    start..start + wanted
}

/// Bit i is whether value i exceeds the threshold.
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
