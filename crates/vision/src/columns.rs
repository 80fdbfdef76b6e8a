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
    /// By block: the step after the last one at which it was in a span.
    worked: Vec<usize>,
    /// The largest of `until`.
    until_any: usize,
    spans: Vec<Range<usize>>,
}

impl Columns {
    /// Forgets the last image; allocates only when the width grows.
    pub(crate) fn start(&mut self, width: usize) {
        self.width = width;
        let blocks = width.div_ceil(BLOCK);
        for steps in [&mut self.until, &mut self.worked] {
            steps.clear();
            steps.resize(blocks, 0);
        }
        self.until_any = 0;
        self.spans.clear();
        self.spans.reserve(blocks.div_ceil(2));
    }

    /// Something was seen in this block; it matters to the steps before `until`, which never falls.
    pub(crate) fn see(&mut self, block: usize, until: usize) {
        if let Some(old) = self.until.get_mut(block) {
            *old = until;
            self.until_any = until;
        }
    }

    /// Finds the spans of this step, maximal and left to right: the blocks that matter and their
    /// neighbours. `fresh` gets the columns that were in no span of the step before.
    pub(crate) fn find_spans(&mut self, step: usize, mut fresh: impl FnMut(Range<usize>)) {
        self.spans.clear();
        if self.until_any <= step {
            return;
        }
        let matters = |block: usize| self.until.get(block).is_some_and(|until| *until > step);
        for (block, worked) in self.worked.iter_mut().enumerate() {
            if !(matters(block) || matters(block + 1) || block > 0 && matters(block - 1)) {
                continue;
            }
            let columns = block * BLOCK..((block + 1) * BLOCK).min(self.width);
            match self.spans.last_mut() {
                Some(span) if span.end == columns.start => span.end = columns.end,
                _ => self.spans.push(columns.clone()),
            }
            // Steps are counted from 0, so that 0 is never "the step before".
            if std::mem::replace(worked, step + 1) != step || step == 0 {
                fresh(columns);
            }
        }
    }

    /// What [`find_spans`](Self::find_spans) found.
    pub(crate) fn spans(&self) -> &[Range<usize>] {
        &self.spans
    }
}
