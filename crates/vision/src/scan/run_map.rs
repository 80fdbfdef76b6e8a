//! The marker pixels of a frame as runs, for random access.

use super::format::MAX_SIDE;
use crate::math::{floor, real};

/// Capacity from the start. A frame with two bands has some hundred runs, one of noise more than these.
const USUAL_RUNS: usize = 1 << 16;

/// The runs of a frame by row.
#[derive(Clone, Debug, Default)]
pub struct RunMap {
    width: usize,
    /// End of each row in `runs`.
    ends: Vec<usize>,
    runs: Vec<(u32, u32)>,
}

impl RunMap {
    /// Clears the map for a new frame. Memory grows only with frames that are higher or noisier than those before.
    pub fn start(&mut self, width: usize, height: usize) {
        self.width = width;
        self.ends.clear();
        self.ends.reserve(height);
        self.runs.clear();
        self.runs.reserve(USUAL_RUNS);
    }

    /// Adds a run to row `v`, below or to the right of those before.
    pub fn add(&mut self, v: usize, start: usize, end: usize) {
        debug_assert!(start < end && end <= MAX_SIDE);
        self.end_rows(v);
        if let (Ok(start), Ok(end)) = (u32::try_from(start), u32::try_from(end)) {
            self.runs.push((start, end));
        }
    }

    /// Ends all rows above row `v`.
    pub fn end_rows(&mut self, v: usize) {
        self.ends.resize(v.max(self.ends.len()), self.runs.len());
    }

    /// Width and height (px).
    pub fn size(&self) -> (f64, f64) {
        (real(self.width), real(self.ends.len()))
    }

    /// Whether the pixel nearest to `[u, v]` (px) is marker; outside the image it is not.
    pub fn is_marker(&self, [u, v]: [f64; 2]) -> bool {
        let (Some(column), Some(row)) = (pixel(u), pixel(v)) else {
            return false;
        };
        let runs = self.row(row);
        let after = runs.partition_point(|run| run.1 as usize <= column);
        runs.get(after).is_some_and(|run| run.0 as usize <= column)
    }

    /// Number of marker pixels in row `v` between columns `from` and `to`, both included (px).
    pub fn count(&self, v: f64, from: f64, to: f64) -> f64 {
        let Some(row) = pixel(v) else {
            return 0.0;
        };
        let runs = self.row(row);
        let first = runs.partition_point(|run| f64::from(run.1) <= from);
        let touching = runs
            .iter()
            .skip(first)
            .take_while(|run| f64::from(run.0) <= to);
        touching
            .map(|run| (f64::from(run.1) - 1.0).min(to) - f64::from(run.0).max(from) + 1.0)
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

/// The nearest pixel of a coordinate, if there is one. `round` would be a slow call, many thousand times per frame.
fn pixel(coordinate: f64) -> Option<usize> {
    (-0.5..65535.5)
        .contains(&coordinate)
        .then(|| floor(coordinate + 0.5))
}

#[cfg(test)]
#[path = "../../tests/units/run_map.rs"]
mod tests;
