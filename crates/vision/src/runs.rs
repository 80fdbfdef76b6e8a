//! Bits to runs.

use std::ops::Range;

use crate::columns::BLOCK;

/// The marker pixels of one row of a window.
#[derive(Clone, Copy, Debug)]
pub struct Runs<'a> {
    marker: &'a [u64],
    worked: &'a [u64],
    origin: usize,
    within: [usize; 2],
}

impl<'a> Runs<'a> {
    /// Of blocks of pixels, a bit each, of which those with a bit in `worked` are meant; `origin` is the
    /// frame's column that is their first, `within` the window's first and the first after it.
    pub(crate) fn new(
        marker: &'a [u64],
        worked: &'a [u64],
        origin: usize,
        within: [usize; 2],
    ) -> Self {
        Self {
            marker,
            worked,
            origin,
            within,
        }
    }

    /// Calls `found(start, end)` for each run of marker pixels; `end` is the first pixel after it.
    #[inline(always)]
    pub fn each(self, mut found: impl FnMut(usize, usize)) {
        let [left, right] = self.within;
        for blocks in runs_of_bits(self.worked.iter().copied()) {
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

/// Calls `found(start, end)` for each maximal run of items that are `inside`.
pub fn each_run<T>(row: &[T], inside: impl Fn(&T) -> bool, mut found: impl FnMut(usize, usize)) {
    let words = row.chunks(BLOCK).map(|block| {
        let bits = block.iter().zip(0..);
        bits.fold(0, |word, (item, u)| word | u64::from(inside(item)) << u)
    });
    for run in runs_of_bits(words) {
        found(run.start, run.end);
    }
}

/// Each maximal run of bits that are set, counted through from the first word's lowest.
#[inline(always)]
pub(crate) fn runs_of_bits<W: IntoIterator<Item = u64>>(words: W) -> BitRuns<W::IntoIter> {
    BitRuns {
        words: words.into_iter(),
        end: 0,
        changes: 0,
        open: None,
    }
}

/// Of [`runs_of_bits`].
pub(crate) struct BitRuns<W> {
    words: W,
    /// The first bit after the word that is looked at.
    end: usize,
    /// A bit for each bit of it that differs from the one before, if that is still to be told.
    changes: u64,
    open: Option<usize>,
}

impl<W: Iterator<Item = u64>> Iterator for BitRuns<W> {
    type Item = Range<usize>;

    #[inline(always)]
    fn next(&mut self) -> Option<Range<usize>> {
        loop {
            while self.changes != 0 {
                let at = self.end - BLOCK + self.changes.trailing_zeros() as usize;
                self.changes &= self.changes - 1;
                match self.open.take() {
                    Some(begun) => return Some(begun..at),
                    None => self.open = Some(at),
                }
            }
            let Some(word) = self.words.next() else {
                return self.open.take().map(|begun| begun..self.end);
            };
            self.changes = word ^ (word << 1 | u64::from(self.open.is_some()));
            self.end += BLOCK;
        }
    }
}
