//! One pass over a frame: project, low-pass, threshold, runs.
//!
//! Most of a frame holds no pixel above the threshold, and the low-pass never exceeds its largest
//! input: only around pixels that exceed the threshold by themselves does it have to be computed.
//! So each row is first scanned, coarsely and quickly, for blocks in which there may be one; rows
//! and columns around those go through the exact arithmetic. What comes out is what would come out
//! if all of the frame did.

use std::ops::Range;

use fearless_simd::{Level, Simd, dispatch};

use crate::columns::{BLOCK, Columns};
use crate::format::Row;
use crate::lowpass::LowPass;
use crate::projection::Projection;
use crate::{ColorDiscriminant, Frame, Window};

/// Pixels scanned together.
const CHUNK: usize = 2 * BLOCK;

/// Pixels of a row looked at together while nothing changes.
const STRETCH: usize = 32;

/// Gives the rows of a frame as marker or not, top to bottom, in memory that does not grow with the
/// image's height.
#[derive(Clone, Debug)]
pub struct Segmenter {
    level: Level,
    discriminant: ColorDiscriminant,
    passes: Vec<LowPass>,
    columns: Columns,
    row: Vec<i16>,
}

impl Segmenter {
    /// With so many passes of the 3x3 binomial low-pass over the projected channel, 0 (none) to 8.
    pub fn new(discriminant: ColorDiscriminant, smoothing: usize) -> Self {
        Self {
            level: Level::new(),
            discriminant,
            passes: vec![LowPass::default(); smoothing],
            columns: Columns::default(),
            row: Vec::new(),
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
        let delay = self.passes.len();
        // What is wrong at the edge of what is read comes one pixel farther in with each pass.
        let read = window.grown(delay, frame);
        let columns = frame.format().whole_groups(read.left..read.right);
        let (width, height) = (columns.len(), read.bottom - read.top);
        let line = |n: usize| Row::of(frame, read.top + n, columns.clone());
        let projection = self.discriminant.projection(frame.format());
        self.prepare(width);
        // A pixel seen in row n matters to the filtered rows n - delay to n + delay, and these need the
        // rows from n - 2 delay to n + 2 delay: scanning goes so far ahead.
        let reach = 2 * delay;
        for n in 0..height + delay + reach {
            if n < height {
                self.scan(line(n), n + reach + 1, &projection);
            }
            let Some(step) = n.checked_sub(reach) else {
                continue;
            };
            let source = (step < height).then(|| line(step));
            self.filter(source, step, height, &projection);
            let Some(v) = step.checked_sub(delay).map(|v| v + read.top) else {
                continue;
            };
            if (window.top..window.bottom).contains(&v) {
                visit(
                    v,
                    Runs {
                        row: &self.row,
                        spans: self.columns.spans(),
                        threshold: projection.threshold(),
                        origin: columns.start,
                        within: [window.left, window.right],
                    },
                );
            }
        }
    }

    fn prepare(&mut self, width: usize) {
        self.row.resize(width, 0);
        self.columns.start(width);
        for pass in &mut self.passes {
            pass.prepare(width);
        }
    }

    /// Finds the blocks of a row in which a pixel exceeds the threshold; they matter until then.
    fn scan(&mut self, row: Row<'_>, until: usize, projection: &Projection) {
        let Self {
            level,
            columns,
            row: projected,
            ..
        } = self;
        dispatch!(*level, simd => scan(simd, row, projected, projection, |block| columns.see(block, until)));
    }

    /// Projects a row where it matters and takes it through the low-passes; pass k is k rows behind.
    fn filter(
        &mut self,
        source: Option<Row<'_>>,
        step: usize,
        height: usize,
        projection: &Projection,
    ) {
        let Self {
            level,
            passes,
            columns,
            row,
            ..
        } = self;
        columns.find_spans(step, |fresh| {
            for pass in &mut *passes {
                pass.forget(fresh.clone());
            }
        });
        let spans = columns.spans();
        if !spans.is_empty() {
            dispatch!(*level, simd => filter(simd, source, row, spans, passes, step, height, projection));
        }
        for pass in passes {
            pass.advance();
        }
    }
}

#[inline(always)]
fn scan<S: Simd>(
    _: S,
    row: Row<'_>,
    scratch: &mut [i16],
    projection: &Projection,
    mut found: impl FnMut(usize),
) {
    let width = scratch.len();
    for start in (0..width).step_by(CHUNK) {
        let end = (start + CHUNK).min(width);
        let chunk = row.columns(start..end);
        if !projection.may_exceed(chunk) {
            continue;
        }
        let Some(values) = scratch.get_mut(start..end) else {
            continue;
        };
        projection.project(chunk, values);
        for (block, values) in (start / BLOCK..).zip(values.chunks(BLOCK)) {
            if values.iter().fold(i16::MIN, |most, value| most.max(*value)) > projection.threshold()
            {
                found(block);
            }
        }
    }
}

#[expect(
    clippy::too_many_arguments,
    reason = "a closure may not be inlined where it counts"
)]
#[inline(always)]
fn filter<S: Simd>(
    _: S,
    source: Option<Row<'_>>,
    row: &mut [i16],
    spans: &[Range<usize>],
    passes: &mut [LowPass],
    step: usize,
    height: usize,
    projection: &Projection,
) {
    for span in spans {
        if let (Some(source), Some(values)) = (source, row.get_mut(span.clone())) {
            projection.project(source.columns(span.clone()), values);
        }
        for (n, pass) in (0..=step).rev().zip(&mut *passes) {
            pass.step(row, span.clone(), n, height);
        }
    }
}

/// One row of a window, projected and low-passed where it may be marker.
#[derive(Clone, Copy, Debug)]
pub struct Runs<'a> {
    row: &'a [i16],
    spans: &'a [Range<usize>],
    threshold: i16,
    /// The frame's column that is the first of `row`.
    origin: usize,
    /// The window's first column and the first after it.
    within: [usize; 2],
}

impl Runs<'_> {
    /// Calls `found(start, end)` for each run of marker pixels; `end` is the first pixel after it.
    pub fn each(self, mut found: impl FnMut(usize, usize)) {
        let [left, right] = self.within;
        for span in self.spans {
            let start = (span.start + self.origin).max(left);
            let end = (span.end + self.origin).min(right);
            let values = self
                .row
                .get(start - self.origin..end.saturating_sub(self.origin));
            each_run(
                values.unwrap_or_default(),
                |value| *value > self.threshold,
                |from, to| found(start + from, start + to),
            );
        }
    }
}

/// Calls `found(start, end)` for each maximal run of items that are `inside`.
pub fn each_run<T>(row: &[T], inside: impl Fn(&T) -> bool, mut found: impl FnMut(usize, usize)) {
    let mut start = None;
    for (index, stretch) in row.chunks(STRETCH).enumerate() {
        // Counting a stretch costs far less than walking it, and most are all one.
        let count: i16 = stretch.iter().map(|item| i16::from(inside(item))).sum();
        if count == 0 && start.is_none()
            || usize::try_from(count) == Ok(stretch.len()) && start.is_some()
        {
            continue;
        }
        for (u, item) in (index * STRETCH..).zip(stretch) {
            match (start, inside(item)) {
                (None, true) => start = Some(u),
                (Some(begun), false) => {
                    found(begun, u);
                    start = None;
                }
                _ => {}
            }
        }
    }
    if let Some(begun) = start {
        found(begun, row.len());
    }
}
