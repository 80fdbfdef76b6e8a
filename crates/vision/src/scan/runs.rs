//! Bit masks to runs.

use std::ops::Range;

use super::active_blocks::BLOCK;

/// The marker pixels of one row of a window.
#[derive(Clone, Copy, Debug)]
pub struct Runs<'a> {
    /// Marker bits of the blocks.
    pub(super) marker: &'a [u64],
    /// Bits of the blocks that are valid.
    pub(super) active: &'a [u64],
    /// Column of the first marker bit.
    pub(super) origin: usize,
    /// First column of the window and the one after its last.
    pub(super) window: [usize; 2],
}

impl Runs<'_> {
    /// Calls `found(start, end)` for each run of marker pixels; `end` is the pixel after its last.
    #[inline(always)]
    pub fn each(self, mut found: impl FnMut(usize, usize)) {
        let [left, right] = self.window;
        for blocks in runs_of_bits(self.active.iter().copied()) {
            let first = blocks.start * BLOCK + self.origin;
            let words = self.marker.get(blocks).unwrap_or_default();
            for run in runs_of_bits(words.iter().copied()) {
                let start = (first + run.start).max(left);
                let end = (first + run.end).min(right);
                if start < end {
                    found(start, end);
                }
            }
        }
    }
}

/// The maximal runs of bits that are set, counted from the lowest bit of the first word.
#[inline(always)]
pub(crate) fn runs_of_bits<W: IntoIterator<Item = u64>>(words: W) -> BitRuns<W::IntoIter> {
    BitRuns {
        words: words.into_iter(),
        end: 0,
        changes: 0,
        start: None,
    }
}

/// Iterator of [`runs_of_bits`].
pub(crate) struct BitRuns<W> {
    words: W,
    /// The bit after the current word.
    end: usize,
    /// The bits of the current word that differ from the one before and are not yet processed.
    changes: u64,
    start: Option<usize>,
}

impl<W: Iterator<Item = u64>> Iterator for BitRuns<W> {
    type Item = Range<usize>;

    #[inline(always)]
    fn next(&mut self) -> Option<Range<usize>> {
        loop {
            while self.changes != 0 {
                let at = self.end - BLOCK + self.changes.trailing_zeros() as usize;
                self.changes &= self.changes - 1;
                match self.start.take() {
                    Some(start) => return Some(start..at),
                    None => self.start = Some(at),
                }
            }
            let Some(word) = self.words.next() else {
                return self.start.take().map(|start| start..self.end);
            };
            self.changes = word ^ (word << 1 | u64::from(self.start.is_some()));
            self.end += BLOCK;
        }
    }
}
