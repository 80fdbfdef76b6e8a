//! The low-pass of Fig. 5, on a stream of rows.

use std::ops::Range;

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
    /// row `n - 1` in their place, the columns' ends treated as the image's edges.
    ///
    /// To be called for `n` = 0, 1, ..., `height`, each followed by [`advance`](Self::advance). The first
    /// call leaves nothing of use, and the last, which asks for the bottom row, does not read `row`.
    /// Nor do calls beyond that, which leave nothing of use.
    #[inline(always)]
    pub(crate) fn step(
        &mut self,
        row: &mut [i16],
        columns: &Range<usize>,
        n: usize,
        height: usize,
    ) {
        let [above, here, below] =
            [&mut self.above, &mut self.here, &mut self.below].map(|row| cut(row, columns));
        if n < height {
            along(row, below);
        } else {
            below.copy_from_slice(here);
        }
        if n == 0 {
            here.copy_from_slice(below);
        }
        combine(above, here, below, row);
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

/// Filters along a row.
#[inline(always)]
fn along(row: &[i16], filtered: &mut [i16]) {
    let Some(last) = row.len().checked_sub(1) else {
        return;
    };
    let at = |u: usize| row[u.min(last)];
    filtered[0] = mean(at(0), at(0), at(1));
    filtered[last] = mean(at(last.saturating_sub(1)), at(last), at(last));
    if last > 1 {
        let (before, after) = (&row[..last - 1], &row[2..]);
        combine(before, &row[1..last], after, &mut filtered[1..last]);
    }
}

/// Filters across three rows.
#[inline(always)]
fn combine(above: &[i16], here: &[i16], below: &[i16], filtered: &mut [i16]) {
    for (((a, b), c), mean_of_three) in above.iter().zip(here).zip(below).zip(filtered) {
        *mean_of_three = mean(*a, *b, *c);
    }
}

/// `(a + 2 b + c) / 4` to the nearest; the values are within +-8191, so no sum leaves an `i16`.
///
/// Never more than the largest of the three, nor less than the least.
#[inline(always)]
fn mean(a: i16, b: i16, c: i16) -> i16 {
    (a + 2 * b + c + 2) >> 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn one_pass_is_the_binomial_filter_to_within_one_unit(
            width in 1..12_usize,
            values in prop::collection::vec(-8191..=8191_i16, 12 * 8),
        ) {
            let rows: Vec<&[i16]> = values.chunks_exact(width).collect();
            let height = rows.len();
            let mut pass = LowPass::default();
            pass.prepare(width);
            for n in 0..=height {
                let mut row = rows.get(n).map_or_else(|| vec![0; width], |row| row.to_vec());
                pass.step(&mut row, &(0..width), n, height);
                pass.advance();
                let Some(v) = n.checked_sub(1) else { continue };
                for (u, filtered) in row.iter().enumerate() {
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
