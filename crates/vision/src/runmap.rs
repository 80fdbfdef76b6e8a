//! All marker pixels of a frame as runs, to be looked at again without the frame.

use crate::frame::MAX_SIDE;
use crate::numbers::{real, whole};

/// More runs than this are noise, and are dropped (2^16; a frame with two bands has some hundred).
pub const MAX_RUNS: usize = 1 << 16;

/// The runs of a frame by row.
#[derive(Clone, Debug, Default)]
pub struct RunMap {
    width: usize,
    /// Where row `v` ends in `runs`.
    ends: Vec<usize>,
    runs: Vec<(u32, u32)>,
}

impl RunMap {
    /// Forgets the last frame; allocates only when a frame is higher than those before.
    pub fn start(&mut self, width: usize, height: usize) {
        self.width = width;
        self.ends.clear();
        self.ends.reserve(height);
        self.runs.clear();
        self.runs.reserve(MAX_RUNS);
    }

    /// Adds a run of the row that is not yet ended, to the right of those before.
    pub fn add(&mut self, start: usize, end: usize) {
        debug_assert!(start < end && end <= MAX_SIDE);
        if let (Ok(start), Ok(end)) = (u32::try_from(start), u32::try_from(end))
            && self.runs.len() < MAX_RUNS
        {
            self.runs.push((start, end));
        }
    }

    /// Ends all rows above row `v`.
    pub fn end_rows(&mut self, v: usize) {
        self.ends.resize(v.max(self.ends.len()), self.runs.len());
    }

    /// Columns and rows (px).
    pub fn size(&self) -> (f64, f64) {
        (real(self.width), real(self.ends.len()))
    }

    /// Whether the pixel at `[u, v]` (px), rounded, is marker; none outside the image is.
    pub fn marker(&self, [u, v]: [f64; 2]) -> bool {
        let (Some(column), Some(row)) = (pixel(u), pixel(v)) else {
            return false;
        };
        let runs = self.row(row);
        let after = runs.partition_point(|run| run.1 as usize <= column);
        runs.get(after).is_some_and(|run| run.0 as usize <= column)
    }

    /// How many marker pixels row `v` has from `from` to `to`, both included (px).
    pub fn count(&self, v: f64, from: f64, to: f64) -> f64 {
        let Some(row) = pixel(v) else {
            return 0.0;
        };
        let runs = self.row(row);
        let first = runs.partition_point(|run| float32(run.1) <= from);
        let touching = runs
            .iter()
            .skip(first)
            .take_while(|run| float32(run.0) <= to);
        touching
            .map(|run| (float32(run.1) - 1.0).min(to) - float32(run.0).max(from) + 1.0)
            .sum()
    }

    fn row(&self, v: usize) -> &[(u32, u32)] {
        let Some(end) = self.ends.get(v) else {
            return &[];
        };
        let start = v.checked_sub(1).and_then(|above| self.ends.get(above));
        self.runs
            .get(*start.unwrap_or(&0)..*end)
            .unwrap_or_default()
    }
}

/// The nearest pixel, if it can be one. Not by `round`, which is a call: this is asked many thousand times a frame.
fn pixel(place: f64) -> Option<usize> {
    (-0.5..65535.5).contains(&place).then(|| whole(place + 0.5))
}

fn float32(pixels: u32) -> f64 {
    f64::from(pixels)
}
