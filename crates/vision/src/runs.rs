//! Bits to runs.

use std::ops::Range;

use crate::columns::BLOCK;

/// The marker pixels of one row of a window.
#[derive(Clone, Copy, Debug)]
pub struct Runs<'a> {
    marker: &'a [u64],
    spans: &'a [Range<usize>],
    origin: usize,
    within: [usize; 2],
}

impl<'a> Runs<'a> {
    /// Of blocks of pixels, a bit each, of which those in `spans` are meant; `origin` is the frame's
    /// column that is their first, `within` the window's first and the first after it.
    pub(crate) fn new(
        marker: &'a [u64],
        spans: &'a [Range<usize>],
        origin: usize,
        within: [usize; 2],
    ) -> Self {
        Self {
            marker,
            spans,
            origin,
            within,
        }
    }

    /// Calls `found(start, end)` for each run of marker pixels; `end` is the first pixel after it.
    #[inline(always)]
    pub fn each(self, mut found: impl FnMut(usize, usize)) {
        let [left, right] = self.within;
        let mut inside = |start: usize, end: usize| {
            let start = (start + self.origin).max(left);
            let end = (end + self.origin).min(right);
            if start < end {
                found(start, end);
            }
        };
        for span in self.spans {
            let blocks = span.start / BLOCK..span.end.div_ceil(BLOCK);
            let words = self.marker.get(blocks).unwrap_or_default();
            each_run_of_bits(words.iter().copied(), |start, end| {
                inside(span.start + start, span.start + end);
            });
        }
    }
}

/// Calls `found(start, end)` for each maximal run of items that are `inside`.
pub fn each_run<T>(row: &[T], inside: impl Fn(&T) -> bool, found: impl FnMut(usize, usize)) {
    let words = row.chunks(BLOCK).map(|block| {
        let bits = block.iter().zip(0..);
        bits.fold(0, |word, (item, u)| word | u64::from(inside(item)) << u)
    });
    each_run_of_bits(words, found);
}

/// Calls `found(start, end)` for each maximal run of bits that are set, counted through from the first word's
/// lowest.
#[inline(always)]
pub(crate) fn each_run_of_bits(
    words: impl IntoIterator<Item = u64>,
    mut found: impl FnMut(usize, usize),
) {
    let (mut open, mut start) = (None, 0);
    for word in words {
        open = runs_of_word(word, start, open, &mut found);
        start += BLOCK;
    }
    if let Some(begun) = open {
        found(begun, start);
    }
}

/// Ends and begins runs where the bits of a word change; the start of a run that is left open.
#[inline(always)]
fn runs_of_word(
    word: u64,
    start: usize,
    mut open: Option<usize>,
    mut found: impl FnMut(usize, usize),
) -> Option<usize> {
    // A bit for each pixel that differs from the one before it.
    let mut changes = word ^ (word << 1 | u64::from(open.is_some()));
    while changes != 0 {
        let at = start + changes.trailing_zeros() as usize;
        match open.take() {
            Some(begun) => found(begun, at),
            None => open = Some(at),
        }
        changes &= changes - 1;
    }
    open
}
