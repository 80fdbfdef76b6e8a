//! Symmetric matrices, each entry stored once.

/// A symmetric matrix of any size N with N (N + 1) / 2 = `LEN`: the lower triangle, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Symmetric<const LEN: usize>([f64; LEN]);

impl<const LEN: usize> Symmetric<LEN> {
    /// Zeros.
    pub const fn zero() -> Self {
        Self([0.0; LEN])
    }

    /// The entry in row `i` and column `j`; NaN outside of the matrix.
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        let (row, column) = if i < j { (j, i) } else { (i, j) };
        let entry = self.0.get(row * (row + 1) / 2 + column);
        entry.copied().unwrap_or(f64::NAN)
    }

    /// Replaces each entry by `next(row, column, entry)`, which has to be symmetric in row and column.
    pub fn update(&mut self, mut next: impl FnMut(usize, usize, f64) -> f64) {
        let (mut row, mut column) = (0, 0);
        for entry in &mut self.0 {
            *entry = next(row, column, *entry);
            column += 1;
            if column > row {
                (row, column) = (row + 1, 0);
            }
        }
    }
}
