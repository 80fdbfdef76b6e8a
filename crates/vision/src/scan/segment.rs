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
use super::filter::Filter;
use super::format::PixelFormat;
use super::frame::{Frame, Window};
use super::projection::{Projection, least_scan_width};
use super::row::Row;
use super::runs::Runs;

/// Finds the runs of marker pixels in the rows of a frame, top to bottom, in memory that does not grow with the
/// frame's height.
#[derive(Clone, Debug)]
pub struct Segmenter {
    level: Level,
    discriminant: ColorDiscriminant,
    /// Projection for the format of the last frame.
    prepared: Option<(PixelFormat, Projection)>,
    active: ActiveBlocks,
    filter: Filter,
}

impl Segmenter {
    /// With `smoothing` passes of the 3x3 binomial low-pass over the projected channel.
    pub fn new(discriminant: ColorDiscriminant, smoothing: usize) -> Self {
        Self {
            level: Level::new(),
            discriminant,
            prepared: None,
            active: ActiveBlocks::default(),
            filter: Filter::new(smoothing),
        }
    }

    /// With the instructions of a level in place of the best ones of this processor.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        Self { level, ..self }
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
        let Self { active, filter, .. } = self;
        dispatch!(self.level, simd => sweep(simd, active, filter, frame, window, projection, visit));
    }
}

/// Scans, filters and passes on the rows of a window that is not empty.
#[inline(always)]
fn sweep<S: Simd>(
    simd: S,
    active: &mut ActiveBlocks,
    filter: &mut Filter,
    frame: &impl Frame,
    window: Window,
    projection: &Projection,
    mut visit: impl FnMut(usize, Runs<'_>),
) {
    let delay = filter.passes();
    // The error at the border of the pixels that are read moves inwards by one pixel per pass.
    let read = window.grown(delay, frame);
    let columns = whole_blocks(read.left..read.right, frame.width());
    let (width, height) = (columns.len(), read.bottom - read.top);
    let line = |n: usize| Row::of(frame, read.top + n).columns(columns.clone());
    // A pixel in row n changes the filtered rows n - delay to n + delay, which depend on rows n - 2 delay to
    // n + 2 delay: the scan is that far ahead.
    let reach = 2 * delay;
    active.start(width, reach);
    filter.start(width, height);
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
            filter.step(simd, active, (first, step), source, projection);
        }
        for step in steps {
            let Some(v) = step.checked_sub(delay).map(|v| v + read.top) else {
                continue;
            };
            if (window.top..window.bottom).contains(&v) && active.is_active(step - first) {
                let runs = Runs {
                    marker: filter.marker(step - first),
                    active: active.active(step - first),
                    origin: columns.start,
                    window: [window.left, window.right],
                };
                visit(v, runs);
            }
        }
    }
}

/// Extends columns to whole blocks, as far as the frame has them, from an even one: it may share U and V with the next.
fn whole_blocks(columns: Range<usize>, width: usize) -> Range<usize> {
    let start = columns.start / 2 * 2;
    let wanted = (columns.end - start).next_multiple_of(BLOCK).min(width);
    let start = start.min(width - wanted);
    start..start + wanted
}
