//! One pass over a frame: project, low-pass, threshold, runs.

use crate::lowpass::LowPass;
use crate::{ColorDiscriminant, Frame};

/// Pixels looked at together while nothing changes.
const BLOCK: usize = 32;

/// Gives the rows of a frame as marker or not, top to bottom, in memory that does not grow with the
/// image's height.
#[derive(Clone, Debug)]
pub struct Segmenter {
    discriminant: ColorDiscriminant,
    passes: Vec<LowPass>,
    row: Vec<i16>,
}

impl Segmenter {
    /// With so many passes of the 3x3 binomial low-pass over the projected channel; 0 is none.
    pub fn new(discriminant: ColorDiscriminant, smoothing: usize) -> Self {
        Self {
            discriminant,
            passes: vec![LowPass::default(); smoothing],
            row: Vec::new(),
        }
    }

    /// Calls `visit(v, runs)` for every row; `runs` calls back with `start..end` of each run of
    /// marker pixels, left to right.
    pub fn each_row(&mut self, frame: &impl Frame, mut visit: impl FnMut(usize, Runs<'_>)) {
        let (width, height) = (frame.width(), frame.height());
        self.row.resize(width, 0);
        for pass in &mut self.passes {
            pass.prepare(width);
        }
        let delay = self.passes.len();
        for step in 0..height + delay {
            if step < height {
                self.discriminant.project(frame.row(step), &mut self.row);
            }
            // Pass k is k rows behind the frame: in the first steps nothing has reached it yet.
            for (n, pass) in (0..=step).rev().zip(&mut self.passes) {
                pass.step(&mut self.row, n, height);
            }
            if let Some(v) = step.checked_sub(delay) {
                let threshold = self.discriminant.threshold();
                visit(
                    v,
                    Runs {
                        row: &self.row,
                        threshold,
                    },
                );
            }
        }
    }
}

/// One row of a frame, projected and low-passed.
#[derive(Clone, Copy, Debug)]
pub struct Runs<'a> {
    row: &'a [i16],
    threshold: i16,
}

impl Runs<'_> {
    /// Calls `found(start, end)` for each run of marker pixels; `end` is the first pixel after it.
    pub fn each(self, found: impl FnMut(usize, usize)) {
        each_run(self.row, |value| *value > self.threshold, found);
    }
}

/// Calls `found(start, end)` for each maximal run of items that are `inside`.
pub fn each_run<T>(row: &[T], inside: impl Fn(&T) -> bool, mut found: impl FnMut(usize, usize)) {
    let mut start = None;
    for (index, block) in row.chunks(BLOCK).enumerate() {
        // Counting a block costs far less than walking it, and most blocks are all one.
        let count: i16 = block.iter().map(|item| i16::from(inside(item))).sum();
        if count == 0 && start.is_none()
            || usize::try_from(count) == Ok(block.len()) && start.is_some()
        {
            continue;
        }
        for (u, item) in (index * BLOCK..).zip(block) {
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
