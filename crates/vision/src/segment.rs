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
use crate::lowpass::LowPass;
use crate::projection::Projection;
use crate::runs::Runs;
use crate::{ColorDiscriminant, Frame, Window};

/// Pixels scanned together: whole blocks.
const CHUNK: usize = 4 * BLOCK;

/// Gives the rows of a frame as marker or not, top to bottom, in memory that does not grow with the
/// image's height.
#[derive(Clone, Debug)]
pub struct Segmenter {
    level: Level,
    discriminant: ColorDiscriminant,
    columns: Columns,
    rows: Rows,
}

/// What becomes of a row on its way.
#[derive(Clone, Debug)]
struct Rows {
    passes: Vec<LowPass>,
    projected: Vec<i16>,
    /// By block, a bit for each pixel: which are marker; kept up within the spans alone.
    marker: Vec<u64>,
}

impl Segmenter {
    /// With so many passes of the 3x3 binomial low-pass over the projected channel, 0 (none) to 8.
    pub fn new(discriminant: ColorDiscriminant, smoothing: usize) -> Self {
        Self {
            level: Level::new(),
            discriminant,
            columns: Columns::default(),
            rows: Rows {
                passes: vec![LowPass::default(); smoothing],
                projected: Vec::new(),
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
        mut visit: impl FnMut(usize, Runs<'_>),
    ) {
        let window = window.within(frame);
        if window.left == window.right || window.top == window.bottom {
            return;
        }
        let delay = self.rows.passes.len();
        // What is wrong at the edge of what is read comes one pixel farther in with each pass.
        let read = window.grown(delay, frame);
        let columns = frame.format().whole_groups(read.left..read.right);
        let columns = whole_blocks(columns, frame.width());
        let (width, height) = (columns.len(), read.bottom - read.top);
        let line = |n: usize| Row::of(frame, read.top + n, columns.clone());
        let projection = self.discriminant.projection(frame.format());
        self.columns.start(width);
        self.rows.start(width);
        // A pixel seen in row n matters to the filtered rows n - delay to n + delay, and these need the
        // rows from n - 2 delay to n + 2 delay: scanning goes so far ahead.
        let reach = 2 * delay;
        // So narrow a window is mostly marker: looking first would cost more than it spares.
        let looks = width >= CHUNK;
        if !looks {
            (0..width.div_ceil(BLOCK)).for_each(|block| self.columns.see(block, 0, usize::MAX));
        }
        for n in (if looks { 0 } else { reach })..height + delay + reach {
            if looks && n < height {
                let (row, seen) = (line(n), &mut self.columns);
                let found = |block| seen.see(block, n.saturating_sub(reach), n + reach + 1);
                dispatch!(self.level, simd => scan(simd, row, width, &projection, found));
            }
            let Some(step) = n.checked_sub(reach) else {
                continue;
            };
            let Self {
                columns: seen,
                rows,
                ..
            } = self;
            seen.find_spans(step, |fresh| rows.forget(&fresh));
            if !seen.spans().is_empty() {
                let place = Place {
                    source: (step < height).then(|| line(step)),
                    step,
                    height,
                };
                let spans = seen.spans();
                dispatch!(self.level, simd => filter(simd, rows, spans, place, &projection));
            }
            rows.advance();
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
}

impl Rows {
    fn start(&mut self, width: usize) {
        self.projected.resize(width, 0);
        self.marker.resize(width.div_ceil(BLOCK), 0);
        for pass in &mut self.passes {
            pass.prepare(width);
        }
    }

    fn forget(&mut self, columns: &Range<usize>) {
        for pass in &mut self.passes {
            pass.forget(columns);
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

/// Finds the blocks of a row in which a pixel may exceed the threshold.
#[inline(always)]
fn scan<S: Simd>(
    simd: S,
    row: Row<'_>,
    width: usize,
    projection: &Projection,
    mut found: impl FnMut(usize),
) {
    for start in (0..width).step_by(CHUNK) {
        // A chunk that is cut short costs more than one that was looked at in part before.
        let tested = start.min(width - CHUNK);
        if projection.may_exceed(simd, row.columns(tested..tested + CHUNK)) {
            let end = (start + CHUNK).min(width);
            (start / BLOCK..end.div_ceil(BLOCK)).for_each(&mut found);
        }
    }
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
        let Some(values) = rows.projected.get_mut(span.clone()) else {
            continue;
        };
        if let Some(source) = source {
            projection.project(source.columns(span.clone()), values);
        }
        for (n, pass) in (0..=step).rev().zip(&mut rows.passes) {
            pass.step(values, span, n, height);
        }
        let words = rows.marker.iter_mut().skip(span.start / BLOCK);
        for (word, values) in words.zip(values.chunks(BLOCK)) {
            *word = above(simd, values, projection.threshold());
        }
    }
}

/// Bit i is whether value i exceeds the threshold.
#[inline(always)]
fn above<S: Simd>(simd: S, values: &[i16], threshold: i16) -> u64 {
    let level = S::i16s::splat(simd, threshold);
    let lanes = S::i16s::LEN;
    let vectors = values.chunks_exact(lanes);
    let mut word = 0;
    for (value, u) in vectors
        .remainder()
        .iter()
        .zip(values.len() / lanes * lanes..)
    {
        word |= u64::from(*value > threshold) << u;
    }
    for (index, vector) in vectors.enumerate() {
        let bits = S::i16s::from_slice(simd, vector)
            .simd_gt(level)
            .to_bitmask();
        word |= bits << (index * lanes);
    }
    word
}
