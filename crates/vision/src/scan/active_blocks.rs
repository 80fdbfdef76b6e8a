//! Blocks of columns that may hold marker pixels, row by row.

/// Columns of a block: the bits of a word.
pub const BLOCK: usize = 64;
/// Bytes of a block where a pixel has three.
pub const BYTES: usize = 3 * BLOCK;

/// Rows of a strip: enough that the work once per strip costs little, and few enough that a strip is still in
/// the first cache when it is read again.
pub const STRIP: usize = 16;

/// The active blocks of a strip of rows: those near a pixel that may be marker. A word has a bit for each of 64
/// blocks.
#[derive(Clone, Debug, Default)]
pub struct ActiveBlocks {
    blocks: usize,
    words: usize,
    reach: usize,
    /// Blocks with such a pixel, in the rows of the strip and `reach` more above and below it.
    hits: Vec<u64>,
    /// Active blocks, in the row above the strip and in those of the strip.
    active: Vec<u64>,
}

impl ActiveBlocks {
    /// Starts an image in which a hit activates its block and the two beside it, up to `reach` rows above and
    /// below. Allocates only when `reach` or the width exceed those before.
    pub fn start(&mut self, width: usize, reach: usize) {
        self.blocks = width.div_ceil(BLOCK);
        self.words = self.blocks.div_ceil(64);
        self.reach = reach;
        for (rows, count) in [
            (&mut self.hits, STRIP + 2 * reach),
            (&mut self.active, STRIP + 1),
        ] {
            rows.clear();
            rows.resize(count * self.words, 0);
        }
    }

    /// Moves down by a strip, which has no hits yet.
    #[inline(always)]
    pub fn next_strip(&mut self) {
        for rows in [&mut self.hits, &mut self.active] {
            let old = (STRIP * self.words).min(rows.len());
            rows.copy_within(old.., 0);
            let new = rows.len() - old;
            rows.get_mut(new..).unwrap_or_default().fill(0);
        }
    }

    /// Blocks with a hit in a row; row 0 is `reach` rows above the strip.
    #[inline(always)]
    pub fn hits(&mut self, row: usize) -> &mut [u64] {
        let words = row * self.words..(row + 1) * self.words;
        self.hits.get_mut(words).unwrap_or_default()
    }

    /// Finds the active blocks of the strip; returns whether there are any, there or in the row above.
    #[inline(always)]
    pub fn activate(&mut self) -> bool {
        // No early exit: with one word per row all rows are combined at once.
        let any = self.hits.iter().fold(0, |all, word| all | word) != 0;
        if any {
            let strip = self.active.get_mut(self.words..).unwrap_or_default();
            for above in 0..=2 * self.reach {
                let rows = self.hits.get(above * self.words..).unwrap_or_default();
                for (active, hits) in strip.iter_mut().zip(rows) {
                    *active |= hits;
                }
            }
            for row in strip.chunks_exact_mut(self.words.max(1)) {
                widen(row, self.blocks);
            }
        }
        any || self.is_active(0)
    }

    /// Whether a block is active in a row of the strip or in the row above it.
    #[inline(always)]
    pub fn is_active(&self, row: usize) -> bool {
        let both = row * self.words..(row + 2) * self.words;
        let words = self.active.get(both).unwrap_or_default();
        words.iter().fold(0, |all, word| all | word) != 0
    }

    /// Active blocks of a row of the strip.
    #[inline(always)]
    pub fn active(&self, row: usize) -> &[u64] {
        self.row(row + 1)
    }

    /// Those that are not active in the row above.
    #[inline(always)]
    pub fn newly_active(&self, row: usize) -> impl Iterator<Item = u64> {
        let both = self.row(row + 1).iter().zip(self.row(row));
        both.map(|(new, old)| new & !old)
    }

    #[inline(always)]
    fn row(&self, row: usize) -> &[u64] {
        let words = row * self.words..(row + 1) * self.words;
        self.active.get(words).unwrap_or_default()
    }
}

/// Sets the neighbours of the bits that are set, within the number of blocks.
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
#[path = "../../tests/units/active_blocks.rs"]
mod tests;
