//! Which columns are worth a closer look, row by row.

/// Columns that are looked at together.
pub(crate) const BLOCK: usize = 64;

/// Rows that are looked at together: long enough that what is done once per strip costs little, and short
/// enough that what was read is still in the cache nearby when it is read again.
pub(crate) const STRIP: usize = 16;

/// Follows in which blocks of columns the rows around have something to be looked at. A word has a bit for
/// each of 64 blocks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns {
    blocks: usize,
    words: usize,
    reach: usize,
    /// The rows of the strip, and `reach` more above and below it.
    seen: Vec<u64>,
    /// The row above the strip, and those of the strip.
    worked: Vec<u64>,
}

impl Columns {
    /// Forgets the last image; in the next, a block matters so many rows up and down, and to its neighbours.
    /// Allocates only when that is more, or rows are wider, than before.
    pub(crate) fn start(&mut self, width: usize, reach: usize) {
        self.blocks = width.div_ceil(BLOCK);
        self.words = self.blocks.div_ceil(64);
        self.reach = reach;
        for (rows, count) in [
            (&mut self.seen, STRIP + 2 * reach),
            (&mut self.worked, STRIP + 1),
        ] {
            rows.clear();
            rows.resize(count * self.words, 0);
        }
    }

    /// Goes a strip down, where nothing has been seen yet.
    #[inline(always)]
    pub(crate) fn next_strip(&mut self) {
        for rows in [&mut self.seen, &mut self.worked] {
            let done = (STRIP * self.words).min(rows.len());
            rows.copy_within(done.., 0);
            let fresh = rows.len() - done;
            rows.get_mut(fresh..).unwrap_or_default().fill(0);
        }
    }

    /// In which blocks a row has something to be looked at, the first row `reach` above the strip.
    #[inline(always)]
    pub(crate) fn seen(&mut self, row: usize) -> &mut [u64] {
        let words = row * self.words..(row + 1) * self.words;
        self.seen.get_mut(words).unwrap_or_default()
    }

    /// Finds the blocks that matter in each row of the strip; whether there are any, or were in the row above it.
    #[inline(always)]
    pub(crate) fn find_worked(&mut self) -> bool {
        // No short way out: of one word to a row all can be looked at together.
        let any = self.seen.iter().fold(0, |all, word| all | word) != 0;
        if any {
            let strip = self.worked.get_mut(self.words..).unwrap_or_default();
            for above in 0..=2 * self.reach {
                let rows = self.seen.get(above * self.words..).unwrap_or_default();
                for (worked, seen) in strip.iter_mut().zip(rows) {
                    *worked |= seen;
                }
            }
            for row in strip.chunks_exact_mut(self.words.max(1)) {
                widen(row, self.blocks);
            }
        }
        any || self.matters(0)
    }

    /// Whether a block matters in a row of the strip, or in the row above that.
    #[inline(always)]
    pub(crate) fn matters(&self, row: usize) -> bool {
        let both = row * self.words..(row + 2) * self.words;
        let words = self.worked.get(both).unwrap_or_default();
        words.iter().fold(0, |all, word| all | word) != 0
    }

    /// The blocks that matter in a row of the strip.
    #[inline(always)]
    pub(crate) fn worked(&self, row: usize) -> &[u64] {
        self.row(row + 1)
    }

    /// Those that did not in the row above.
    #[inline(always)]
    pub(crate) fn fresh(&self, row: usize) -> impl Iterator<Item = u64> {
        let both = self.row(row + 1).iter().zip(self.row(row));
        both.map(|(new, old)| new & !old)
    }

    #[inline(always)]
    fn row(&self, row: usize) -> &[u64] {
        let words = row * self.words..(row + 1) * self.words;
        self.worked.get(words).unwrap_or_default()
    }
}

/// Adds the neighbours of bits, as far as there are blocks.
#[inline(always)]
fn widen(row: &mut [u64], blocks: usize) {
    let mut before = 0;
    for index in 0..row.len() {
        let after = row.get(index + 1).copied().unwrap_or_default();
        if let Some(word) = row.get_mut(index) {
            let here = *word;
            *word |= here << 1 | here >> 1 | before >> 63 | after << 63;
            before = here;
        }
    }
    if let Some(last) = row.last_mut() {
        *last &= u64::MAX >> ((64 - blocks % 64) % 64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_worked_is_what_matters_and_its_neighbours(
            width in prop_oneof![1..400_usize, 4000..9000_usize],
            reach in 0..6_usize,
            rows in prop::collection::vec(prop::collection::vec(any::<u16>(), 0..3), 1..60),
            quiet in 0..60_usize,
        ) {
            let blocks = width.div_ceil(BLOCK);
            let rows: Vec<Vec<usize>> = rows.into_iter().enumerate()
                .map(|(n, row)| if n.abs_diff(quiet) < 25 { vec![] } else {
                    row.into_iter().map(|b| usize::from(b) % blocks).collect()
                })
                .collect();
            let worked = |n: usize| -> Vec<bool> {
                let around = n.saturating_sub(reach)..(n + reach + 1).min(rows.len());
                let seen = rows.get(around).unwrap_or_default().concat();
                (0..blocks).map(|block| seen.iter().any(|b| block.abs_diff(*b) <= 1)).collect()
            };
            let bits = |words: &[u64]| -> Vec<bool> {
                (0..64 * words.len()).map(|b| words[b / 64] >> (b % 64) & 1 == 1).collect()
            };
            let mut columns = Columns::default();
            columns.start(width, reach);
            let mut seen = 0;
            for first in (0..rows.len()).step_by(STRIP) {
                columns.next_strip();
                let ahead = rows.len().min(first + STRIP + reach);
                for (n, row) in rows.iter().enumerate().take(ahead).skip(seen) {
                    let words = columns.seen(n + reach - first);
                    for b in row {
                        words[b / 64] |= 1 << (b % 64);
                    }
                }
                seen = ahead;
                let any = columns.find_worked();
                for n in first..rows.len().min(first + STRIP) {
                    let (found, expected) = (bits(columns.worked(n - first)), worked(n));
                    prop_assert_eq!(&found[..blocks], &expected[..], "row {}", n);
                    prop_assert!(found[blocks..].iter().all(|bit| !bit));
                    prop_assert!(any || !expected.contains(&true));
                    let above = n.checked_sub(1).map_or(vec![false; blocks], worked);
                    let fresh = bits(&columns.fresh(n - first).collect::<Vec<u64>>());
                    let expected = expected.iter().zip(above).map(|(new, old)| *new && !old);
                    prop_assert_eq!(&fresh[..blocks], &expected.collect::<Vec<bool>>()[..]);
                }
            }
        }
    }
}
