//! The low-pass filter of Fig. 5, on a stream of rows.

use std::ops::Range;

use fearless_simd::prelude::*;

use super::active_blocks::BLOCK;

/// One pass of the separable 3x3 binomial filter, `[1 2 1] / 4` along rows and along columns, with the image's
/// border replicated.
///
/// Its output is one row behind: from row `n` it computes the filtered row `n - 1`. Each direction rounds to the
/// nearest unit, halves upwards. Several passes approach a Gaussian of
/// variance 1/2 px^2 per pass.
#[derive(Clone, Debug, Default)]
pub struct LowPass {
    above: Vec<Block>,
    here: Vec<Block>,
    below: Vec<Block>,
}

/// Values of a block of columns.
pub type Block = [i16; BLOCK];

/// Below every projected value, and four of it still fit an `i16`.
const FAR_BELOW: i16 = -8191;

impl LowPass {
    /// Makes room for rows of this many blocks; allocates only when the number grows.
    pub fn prepare(&mut self, blocks: usize) {
        for row in [&mut self.above, &mut self.here, &mut self.below] {
            row.resize(blocks, [FAR_BELOW; BLOCK]);
        }
    }

    /// Resets the previous rows of these blocks to values far below any threshold.
    pub fn reset(&mut self, blocks: &Range<usize>) {
        for row in [&mut self.above, &mut self.here] {
            cut(row, blocks).fill([FAR_BELOW; BLOCK]);
        }
    }

    /// Filters these blocks of row `n` of an image into those of row `n - 1`; their first and last values are replicated.
    ///
    /// Call it for `n` = 0, 1, ..., `height`, each time followed by [`advance`](Self::advance). The output for
    /// `n` = 0 and above `height` is meaningless; from `n` = `height` on, `row` is not read.
    #[inline(always)]
    pub fn step<S: Simd>(
        &mut self,
        simd: S,
        row: &[Block],
        filtered: &mut [Block],
        blocks: &Range<usize>,
        (n, height): (usize, usize),
    ) {
        let [above, here, below] =
            [&mut self.above, &mut self.here, &mut self.below].map(|row| cut(row, blocks));
        let (Some([first, ..]), Some([.., last])) = (row.first(), row.last()) else {
            return;
        };
        let (mut before, end) = (S::i16s::splat(simd, *first), S::i16s::splat(simd, *last));
        let following = row.get(1..).unwrap_or_default().iter().map(Some);
        let three = above.iter_mut().zip(here).zip(below);
        let rows = row.iter().zip(following.chain([None])).zip(three);
        for (((row, following), ((above, here), below)), filtered) in rows.zip(filtered) {
            let after = match following {
                Some(block) => S::i16s::from_slice(simd, &block[..S::i16s::LEN]),
                None => end,
            };
            let kept = [above, here, below, filtered];
            step(simd, [before, after], row, kept, (n, height));
            before = S::i16s::from_slice(simd, &row[BLOCK - S::i16s::LEN..]);
        }
    }

    /// Row `n` becomes row `n - 1`.
    pub fn advance(&mut self) {
        std::mem::swap(&mut self.above, &mut self.here);
        std::mem::swap(&mut self.here, &mut self.below);
    }
}

/// These blocks of a row.
pub fn cut<'a>(row: &'a mut [Block], blocks: &Range<usize>) -> &'a mut [Block] {
    row.get_mut(blocks.clone()).unwrap_or_default()
}

/// One block of a step, between the vectors before and after it; neighbours are shifted together in registers.
#[inline(always)]
fn step<S: Simd>(
    simd: S,
    [mut before, after]: [S::i16s; 2],
    row: &Block,
    [above, here, below, filtered]: [&mut Block; 4],
    (n, height): (usize, usize),
) {
    let lanes = S::i16s::LEN;
    let mut middle = S::i16s::from_slice(simd, &row[..lanes]);
    for start in (0..BLOCK).step_by(lanes) {
        let end = start + lanes;
        let next = match row.get(end..end + lanes) {
            Some(values) => S::i16s::from_slice(simd, values),
            None => after,
        };
        let centre = S::i16s::from_slice(simd, &here[start..end]);
        let under = if n < height {
            let left = shift_in::<S>(before, middle);
            mean::<S>(left, middle, middle.slide::<1>(next))
        } else {
            centre
        };
        under.store_slice(&mut below[start..end]);
        if n == 0 {
            under.store_slice(&mut here[start..end]);
        }
        let over = S::i16s::from_slice(simd, &above[start..end]);
        mean::<S>(over, centre, under).store_slice(&mut filtered[start..end]);
        (before, middle) = (middle, next);
    }
}

/// The last value of one vector and all but the last of the next.
#[inline(always)]
fn shift_in<S: Simd>(before: S::i16s, values: S::i16s) -> S::i16s {
    match S::i16s::LEN {
        32 => before.slide::<31>(values),
        16 => before.slide::<15>(values),
        _ => before.slide::<7>(values),
    }
}

/// Replicates the last of the first `width` values to the end of the row.
#[inline(always)]
pub fn replicate_end(row: &mut [Block], width: usize) {
    if !width.is_multiple_of(BLOCK)
        && let Some([last, beyond @ ..]) = row.as_flattened_mut().get_mut(width.saturating_sub(1)..)
    {
        beyond.fill(*last);
    }
}

/// `(a + 2 b + c) / 4`, rounded; the values are within +-8191, so that the sum fits an `i16`.
#[inline(always)]
fn mean<S: Simd>(a: S::i16s, b: S::i16s, c: S::i16s) -> S::i16s {
    (a + b + b + c + 2) >> 2
}
