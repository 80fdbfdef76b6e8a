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
use crate::projection::{AT_ONCE, Projection};
use crate::runs::Runs;
use crate::{ColorDiscriminant, Frame, Window};

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
    /// With a value more on either side.
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
        visit: impl FnMut(usize, Runs<'_>),
    ) {
        let window = window.within(frame);
        if window.left < window.right && window.top < window.bottom {
            let projection = self.discriminant.projection(frame.format());
            let Self { columns, rows, .. } = self;
            dispatch!(self.level, simd => sweep(simd, columns, rows, frame, window, &projection, visit));
        }
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
    // So narrow a window is mostly marker: looking first would cost more than it spares.
    let scan = (width >= AT_ONCE).then(|| projection.scan());
    let ahead = if scan.is_some() { reach } else { 0 };
    for n in 0..height + delay + ahead {
        seen.add_row(|hot| match &scan {
            Some(scan) if n < height => scan.mark(simd, line(n), width, hot),
            Some(_) => {}
            None => hot.fill(u64::MAX),
        });
        let Some(step) = n.checked_sub(ahead) else {
            continue;
        };
        seen.find_spans(|fresh| rows.forget(&fresh));
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
        self.projected.resize(width + 2, 0);
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
        let padded = rows.projected.get_mut(span.start..span.end + 2);
        let Some(padded) = padded else { continue };
        let Some(values) = padded.get_mut(1..=span.len()) else {
            continue;
        };
        if let Some(source) = source {
            projection.project(simd, source.columns(span.clone()), values);
        }
        for (n, pass) in (0..=step).rev().zip(&mut rows.passes) {
            pass.step(simd, padded, span, n, height);
        }
        let values = padded.get(1..=span.len()).unwrap_or_default();
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
