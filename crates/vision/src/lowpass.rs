//! The low-pass of Fig. 5, on a stream of rows.

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

impl LowPass {
    /// Makes room for rows of this width; allocates only when they grow.
    pub(crate) fn prepare(&mut self, width: usize) {
        for row in [&mut self.above, &mut self.here, &mut self.below] {
            row.resize(width, 0);
        }
    }

    /// Takes row `n` of an image of `height` rows and leaves the filtered row `n - 1` in its place.
    ///
    /// To be called for `n` = 0, 1, ..., `height`. The first call leaves nothing of use, and in the
    /// last, which asks for the bottom row, what `row` held does not count.
    pub(crate) fn step(&mut self, row: &mut [i16], n: usize, height: usize) {
        if n < height {
            along(row, &mut self.below);
        } else {
            self.below.copy_from_slice(&self.here);
        }
        if n == 0 {
            self.here.copy_from_slice(&self.below);
        }
        combine(&self.above, &self.here, &self.below, row);
        std::mem::swap(&mut self.above, &mut self.here);
        std::mem::swap(&mut self.here, &mut self.below);
    }
}

/// Filters along a row.
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
fn combine(above: &[i16], here: &[i16], below: &[i16], filtered: &mut [i16]) {
    for (((a, b), c), mean_of_three) in above.iter().zip(here).zip(below).zip(filtered) {
        *mean_of_three = mean(*a, *b, *c);
    }
}

/// `(a + 2 b + c) / 4` to the nearest; the values are within +-8191, so no sum leaves an `i16`.
fn mean(a: i16, b: i16, c: i16) -> i16 {
    (a + 2 * b + c + 2) >> 2
}
