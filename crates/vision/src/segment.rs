//! One pass over a frame: project, low-pass, threshold, runs.
//!
//! Most of a frame holds no pixel above the threshold, and the low-pass never exceeds its largest
//! input: only around pixels that exceed the threshold by themselves does it have to be computed.
//! So each row is first scanned, coarsely and quickly, for blocks in which there may be one; rows
//! and columns around those go through the exact arithmetic. What comes out is what would come out
//! if all of the frame did.

use std::ops::Range;

use fearless_simd::{Level, dispatch, prelude::*};

use crate::columns::{BLOCK, Columns};
use crate::format::Row;
use crate::lowpass::{At, LowPass, repeat_ends};
use crate::projection::{Projection, worth_a_look};
use crate::runs::Runs;
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
    passes: Vec<LowPass>,
    /// What goes into a pass and what comes out, with a value more on either side.
    values: [Vec<i16>; 2],
    /// By block, a bit for each pixel: which are marker; kept up within the spans alone.
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
                passes: vec![LowPass::default(); smoothing],
                values: [const { Vec::new() }; 2],
                marker: Vec::new(),
            },
        }
    }

    /// Calls `visit(v, runs)` for every row; `runs` calls back with `start..end` of each run of
    /// marker pixels, left to right.
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
    seen.start(width, 2 * reach + 1);
    rows.start(width);
    // In a window so narrow, looking first would cost more than it spares.
    let looks = width >= worth_a_look(simd, frame.format());
    let ahead = if looks { reach } else { 0 };
    if !looks {
        seen.next_row().fill(u64::MAX);
        seen.end_row();
        seen.find_spans(|fresh| rows.forget(&fresh));
    }
    for n in 0..height + delay + ahead {
        if looks {
            let hot = seen.next_row();
            if n < height {
                projection.mark(simd, line(n), width, hot);
            }
            seen.end_row();
        }
        let Some(step) = n.checked_sub(ahead) else {
            continue;
        };
        if looks {
            seen.find_spans(|fresh| rows.forget(&fresh));
        }
        if !seen.spans().is_empty() {
            let place = Place {
                source: (step < height).then(|| line(step)),
                step,
                height,
            };
            filter(simd, rows, seen.spans(), place, projection);
            rows.advance();
        }
        let Some(v) = step.checked_sub(delay).map(|v| v + read.top) else {
            continue;
        };
        if (window.top..window.bottom).contains(&v) {
            let within = [window.left, window.right];
            visit(
                v,
                Runs::new(&rows.marker, seen.spans(), columns.start, within),
            );
        }
    }
}

impl Rows {
    fn start(&mut self, width: usize) {
        let blocks = width.div_ceil(BLOCK);
        for values in &mut self.values {
            values.resize(blocks * BLOCK + 2, 0);
        }
        self.marker.resize(blocks, 0);
        for pass in &mut self.passes {
            pass.prepare(blocks);
        }
    }

    fn forget(&mut self, columns: &Range<usize>) {
        for pass in &mut self.passes {
            pass.forget(&blocks_of(columns));
        }
    }

    fn advance(&mut self) {
        for pass in &mut self.passes {
            pass.advance();
        }
    }
}

/// These columns and as many more as make whole blocks, if the frame has them.
fn whole_blocks(columns: Range<usize>, width: usize) -> Range<usize> {
    let wanted = columns.len().next_multiple_of(BLOCK).min(width);
    let start = columns.start.min(width - wanted);
    start..start + wanted
}

/// Where the pass over the frame is.
#[derive(Clone, Copy)]
struct Place<'a> {
    /// The row that comes in, unless all of them have.
    source: Option<Row<'a>>,
    step: usize,
    height: usize,
}

/// Projects a row where it matters, takes it through the low-passes, of which pass k is k rows
/// behind, and holds what comes out against the threshold.
#[inline(always)]
fn filter<S: Simd>(
    simd: S,
    rows: &mut Rows,
    spans: &[Range<usize>],
    Place {
        source,
        step,
        height,
    }: Place<'_>,
    projection: &Projection,
) {
    for span in spans {
        let blocks = blocks_of(span);
        let padded = span.start..blocks.end * BLOCK + 2;
        let [values, filtered] = rows.values.each_mut();
        let Some(mut values) = values.get_mut(padded.clone()) else {
            continue;
        };
        let Some(mut filtered) = filtered.get_mut(padded) else {
            continue;
        };
        if let (Some(source), Some(values)) = (source, values.get_mut(1..=span.len())) {
            projection.project(simd, source.columns(span.clone()), values);
        }
        for (n, pass) in (0..=step).rev().zip(&mut rows.passes) {
            repeat_ends(values, span.len());
            pass.step(simd, values, filtered, &blocks, At { n, height });
            (values, filtered) = (filtered, values);
        }
        let values = values.get(1..).unwrap_or_default().as_chunks().0;
        let words = rows.marker.get_mut(blocks).unwrap_or_default();
        for (word, values) in words.iter_mut().zip(values) {
            *word = above(simd, values, projection.threshold());
        }
        // What lies beyond the image is no pixel.
        let beyond = words.len() * BLOCK - span.len();
        if let Some(word) = words.last_mut() {
            *word &= u64::MAX >> beyond;
        }
    }
}

/// The blocks of columns that begin with one.
fn blocks_of(columns: &Range<usize>) -> Range<usize> {
    columns.start / BLOCK..columns.end.div_ceil(BLOCK)
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
