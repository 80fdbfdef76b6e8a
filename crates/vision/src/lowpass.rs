//! The low-pass of Fig. 5, on a stream of rows.

use std::ops::{Add, Range, Shr};

use fearless_simd::prelude::*;

/// One pass of the separable 3x3 binomial filter, `[1 2 1] / 4` along rows and along columns, the
/// image's edges replicated.
///
/// It keeps two rows and is one row behind: fed row `n`, it gives the filtered row `n - 1`.
/// Each direction rounds to the nearest unit, halves upwards. Several passes approach a Gaussian of
/// variance 1/2 px^2 per pass.
#[derive(Clone, Debug, Default)]
pub(crate) struct LowPass {
    above: Vec<i16>,
    here: Vec<i16>,
    below: Vec<i16>,
}

/// Below every projected value, and still four of it fit an `i16`.
const NEVER: i16 = -8191;

impl LowPass {
    /// Makes room for rows of this width; allocates only when they grow.
    pub(crate) fn prepare(&mut self, width: usize) {
        for row in [&mut self.above, &mut self.here, &mut self.below] {
            row.resize(width, NEVER);
        }
    }

    /// Forgets the rows so far in these columns: as if they had been far below any threshold.
    #[inline(always)]
    pub(crate) fn forget(&mut self, columns: &Range<usize>) {
        for row in [&mut self.above, &mut self.here] {
            cut(row, columns).fill(NEVER);
        }
    }

    /// Takes these columns of row `n` of an image of `height` rows and leaves those of the filtered
    /// row `n - 1` in their place, the columns' ends treated as the image's edges. `row` has one value
    /// more on either side, which are made to repeat those ends.
    ///
    /// To be called for `n` = 0, 1, ..., `height`, each followed by [`advance`](Self::advance). The first
    /// call leaves nothing of use, and the last, which asks for the bottom row, does not read `row`.
    /// Nor do calls beyond that, which leave nothing of use.
    #[inline(always)]
    pub(crate) fn step<S: Simd>(
        &mut self,
        simd: S,
        row: &mut [i16],
        columns: &Range<usize>,
        n: usize,
        height: usize,
    ) {
        let [above, here, below] =
            [&mut self.above, &mut self.here, &mut self.below].map(|row| cut(row, columns));
        if n < height {
            repeat_ends(row);
            combine(simd, row, &row[1..], &row[2..], below);
        } else {
            below.copy_from_slice(here);
        }
        if n == 0 {
            here.copy_from_slice(below);
        }
        let filtered = row.get_mut(1..=columns.len()).unwrap_or_default();
        combine(simd, above, here, below, filtered);
    }

    /// Row `n` becomes row `n - 1`.
    pub(crate) fn advance(&mut self) {
        std::mem::swap(&mut self.above, &mut self.here);
        std::mem::swap(&mut self.here, &mut self.below);
    }
}

fn cut<'a>(row: &'a mut [i16], columns: &Range<usize>) -> &'a mut [i16] {
    row.get_mut(columns.clone()).unwrap_or_default()
}

fn repeat_ends(row: &mut [i16]) {
    if let [left, first, ..] = row {
        *left = *first;
    }
    if let [.., last, right] = row {
        *right = *last;
    }
}

/// Filters across three rows, or along one that is given three times, as far as `filtered` goes.
#[inline(always)]
fn combine<S: Simd>(simd: S, above: &[i16], here: &[i16], below: &[i16], filtered: &mut [i16]) {
    let lanes = S::i16s::LEN;
    let whole = |row| <[i16]>::chunks_exact(row, lanes);
    let load = |values: &[i16]| S::i16s::from_slice(simd, values);
    let done = filtered.len() / lanes * lanes;
    let means = filtered.chunks_exact_mut(lanes);
    for (((a, b), c), means) in whole(above).zip(whole(here)).zip(whole(below)).zip(means) {
        let (a, b, c) = (load(a), load(b), load(c));
        mean(a, b, c, 2).store_slice(means);
    }
    let rest = above.iter().zip(here).zip(below).zip(filtered).skip(done);
    for (((a, b), c), mean_of_three) in rest {
        *mean_of_three = mean(*a, *b, *c, 2);
    }
}

/// `(a + 2 b + c) / 4` to the nearest; the values are within +-8191, so no sum leaves an `i16`.
///
/// Never more than the largest of the three, nor less than the least.
#[inline(always)]
fn mean<T>(a: T, b: T, c: T, half: i16) -> T
where
    T: Copy + Add<Output = T> + Add<i16, Output = T> + Shr<u32, Output = T>,
{
    (a + b + b + c + half) >> 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn one_pass_is_the_binomial_filter_to_within_one_unit(
            width in 1..100_usize,
            values in prop::collection::vec(-8191..=8191_i16, 100 * 4),
            best in any::<bool>(),
        ) {
            let rows: Vec<&[i16]> = values.chunks_exact(width).collect();
            let height = rows.len();
            let level = if best { Level::new() } else { Level::baseline() };
            let mut pass = LowPass::default();
            pass.prepare(width);
            for n in 0..=height {
                let mut row = vec![0; width + 2];
                if let Some(values) = rows.get(n) {
                    row[1..=width].copy_from_slice(values);
                }
                dispatch!(level, simd => pass.step(simd, &mut row, &(0..width), n, height));
                pass.advance();
                let Some(v) = n.checked_sub(1) else { continue };
                for (u, filtered) in row[1..=width].iter().enumerate() {
                    let mut exact = 0;
                    for (dv, weight_v) in [(0, 1), (1, 2), (2, 1)] {
                        for (du, weight_u) in [(0, 1), (1, 2), (2, 1)] {
                            let v = (v + dv).clamp(1, height) - 1;
                            let u = (u + du).clamp(1, width) - 1;
                            exact += weight_v * weight_u * i32::from(rows[v][u]);
                        }
                    }
                    prop_assert!((16 * i32::from(*filtered) - exact).abs() <= 16);
                }
            }
        }
    }
}
