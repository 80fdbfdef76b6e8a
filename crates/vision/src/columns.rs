//! Which columns are worth a closer look, row by row.

use std::ops::Range;

use crate::runs::each_run_of_bits;

/// Columns that are looked at together.
pub(crate) const BLOCK: usize = 64;

/// Follows in which blocks of columns the last rows have something to be looked at. A word has a bit for
/// each of 64 blocks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns {
    width: usize,
    words: usize,
    /// The last rows, the newest at `newest`, in a ring.
    seen: Vec<u64>,
    newest: usize,
    /// Rows that came since something was seen.
    quiet: usize,
    /// The blocks in the spans, and what will be.
    worked: Vec<u64>,
    wanted: Vec<u64>,
    spans: Vec<Range<usize>>,
}

impl Columns {
    /// Forgets the last image, and will remember so many rows, at least one, of the next; allocates only when
    /// they are more or wider than before.
    pub(crate) fn start(&mut self, width: usize, rows: usize) {
        self.width = width;
        let blocks = width.div_ceil(BLOCK);
        self.words = blocks.div_ceil(64);
        self.newest = 0;
        self.quiet = rows;
        for (row, length) in [
            (&mut self.seen, rows * self.words),
            (&mut self.worked, self.words),
            (&mut self.wanted, self.words),
        ] {
            row.clear();
            row.resize(length, 0);
        }
        self.spans.clear();
        self.spans.reserve(blocks.div_ceil(2));
    }

    /// A row in place of the oldest, all 0: the bits of the blocks that matter are to be set, then
    /// [`end_row`](Self::end_row) called. Not a closure: one that is not inlined has no vectors.
    #[inline(always)]
    pub(crate) fn next_row(&mut self) -> &mut [u64] {
        self.newest += self.words;
        if self.newest >= self.seen.len() {
            self.newest = 0;
        }
        let row = self.row();
        if let [word] = row {
            *word = 0;
        } else {
            row.fill(0);
        }
        row
    }

    /// Takes note of whether the row has something that matters.
    #[inline(always)]
    pub(crate) fn end_row(&mut self) {
        let quiet = self.row().iter().all(|word| *word == 0);
        self.quiet = if quiet {
            self.quiet.saturating_add(1)
        } else {
            0
        };
    }

    #[inline(always)]
    fn row(&mut self) -> &mut [u64] {
        let row = self.newest..self.newest + self.words;
        self.seen.get_mut(row).unwrap_or_default()
    }

    /// Finds the spans of columns, maximal and left to right: the blocks that matter in the rows that are
    /// remembered, and their neighbours. `fresh` gets the columns that were in no span before.
    #[inline(always)]
    pub(crate) fn find_spans(&mut self, fresh: impl FnMut(Range<usize>)) {
        let remembered = self.seen.len();
        if self.spans.is_empty() && self.quiet.saturating_mul(self.words) >= remembered {
            return;
        }
        if self.join_rows() {
            self.change_spans(fresh);
        }
    }

    /// What [`find_spans`](Self::find_spans) found.
    pub(crate) fn spans(&self) -> &[Range<usize>] {
        &self.spans
    }

    /// What is wanted; whether that is not what is worked.
    #[inline(always)]
    fn join_rows(&mut self) -> bool {
        let blocks = self.width.div_ceil(BLOCK);
        let (mut before, mut here) = (0, self.joined(0));
        let mut changed = false;
        for index in 0..self.words {
            let after = self.joined(index + 1);
            let mut word = here | here << 1 | here >> 1 | before >> 63 | after << 63;
            if index + 1 == self.words {
                word &= u64::MAX >> ((64 - blocks % 64) % 64);
            }
            (before, here) = (here, after);
            if let (Some(wanted), Some(worked)) =
                (self.wanted.get_mut(index), self.worked.get(index))
            {
                *wanted = word;
                changed |= word != *worked;
            }
        }
        changed
    }

    /// This word of all rows.
    #[inline(always)]
    fn joined(&self, index: usize) -> u64 {
        if index >= self.words {
            return 0;
        }
        let rows = self.seen.iter().skip(index).step_by(self.words);
        rows.fold(0, |all, word| all | word)
    }

    fn change_spans(&mut self, mut fresh: impl FnMut(Range<usize>)) {
        let Self {
            width,
            worked,
            wanted,
            spans,
            ..
        } = self;
        let columns = |start: usize, end: usize| start * BLOCK..(end * BLOCK).min(*width);
        let new = wanted.iter().zip(&*worked).map(|(new, old)| new & !old);
        each_run_of_bits(new, |start, end| fresh(columns(start, end)));
        spans.clear();
        let all = wanted.iter().copied();
        each_run_of_bits(all, |start, end| spans.push(columns(start, end)));
        std::mem::swap(worked, wanted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn spans_are_what_matters_and_its_neighbours(
            width in prop_oneof![1..400_usize, 4000..9000_usize],
            remembered in 1..6_usize,
            rows in prop::collection::vec(prop::collection::vec(any::<u16>(), 0..3), 1..12),
        ) {
            let blocks = width.div_ceil(BLOCK);
            let rows: Vec<Vec<usize>> =
                rows.into_iter().map(|row| row.into_iter().map(|b| usize::from(b) % blocks).collect()).collect();
            let mut columns = Columns::default();
            columns.start(width, remembered);
            let mut before = vec![false; width];
            for n in 0..rows.len() {
                let words = columns.next_row();
                rows[n].iter().for_each(|b| words[b / 64] |= 1 << (b % 64));
                columns.end_row();
                let mut fresh = vec![false; width];
                columns.find_spans(|new| fresh[new].fill(true));
                let last = rows[(n + 1).saturating_sub(remembered)..=n].concat();
                let inside: Vec<bool> =
                    (0..width).map(|u| last.iter().any(|b| (u / BLOCK).abs_diff(*b) <= 1)).collect();
                let expected: Vec<bool> =
                    inside.iter().zip(&before).map(|(now, before)| *now && !before).collect();
                prop_assert_eq!(fresh, expected);
                let mut spanned = vec![false; width];
                for span in columns.spans() {
                    prop_assert!(span.start == 0 || !spanned[span.start - 1]);
                    spanned[span.clone()].fill(true);
                }
                prop_assert_eq!(&spanned, &inside);
                before = inside;
            }
        }
    }
}
