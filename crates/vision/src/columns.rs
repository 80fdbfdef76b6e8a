//! Which columns are worth a closer look, row by row.

use std::ops::Range;

/// Columns that are looked at together.
pub(crate) const BLOCK: usize = 64;

/// Follows, by block of columns, until when what was seen there matters.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns {
    width: usize,
    /// By block: the first step at which it no longer matters; 0 if nothing was seen yet.
    until: Vec<usize>,
    /// By block: whether it is in a span.
    worked: Vec<bool>,
    /// The step at which the spans have to be found anew, unless something is seen before.
    change: usize,
    spans: Vec<Range<usize>>,
}

impl Columns {
    /// Forgets the last image; allocates only when the width grows.
    pub(crate) fn start(&mut self, width: usize) {
        self.width = width;
        let blocks = width.div_ceil(BLOCK);
        self.until.clear();
        self.until.resize(blocks, 0);
        self.worked.clear();
        self.worked.resize(blocks, false);
        self.change = usize::MAX;
        self.spans.clear();
        self.spans.reserve(blocks.div_ceil(2));
    }

    /// Something was seen in this block; it matters to `step` and those after it before `until`, which
    /// never falls.
    pub(crate) fn see(&mut self, block: usize, step: usize, until: usize) {
        if let Some(old) = self.until.get_mut(block) {
            if *old <= step {
                self.change = step;
            }
            *old = until;
        }
    }

    /// Finds the spans of this step, maximal and left to right: the blocks that matter and their
    /// neighbours. `fresh` gets the columns that were in no span of the step before.
    pub(crate) fn find_spans(&mut self, step: usize, mut fresh: impl FnMut(Range<usize>)) {
        if step < self.change {
            return;
        }
        self.spans.clear();
        self.change = usize::MAX;
        let matters = |block: usize| self.until.get(block).is_some_and(|until| *until > step);
        for (block, worked) in self.worked.iter_mut().enumerate() {
            let before = *worked;
            *worked = matters(block) || matters(block + 1) || block > 0 && matters(block - 1);
            if !*worked {
                continue;
            }
            if let Some(until) = self.until.get(block).filter(|until| **until > step) {
                self.change = self.change.min(*until);
            }
            let columns = block * BLOCK..((block + 1) * BLOCK).min(self.width);
            match self.spans.last_mut() {
                Some(span) if span.end == columns.start => span.end = columns.end,
                _ => self.spans.push(columns.clone()),
            }
            if !before {
                fresh(columns);
            }
        }
    }

    /// What [`find_spans`](Self::find_spans) found.
    pub(crate) fn spans(&self) -> &[Range<usize>] {
        &self.spans
    }
}
