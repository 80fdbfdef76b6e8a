//! Whitening of the features of two markers.

use core::array;

use crate::dof::all_finite;

/// A vector of features (4,), and a symmetric matrix of their size.
pub type Features = [f64; 4];
pub type Square = [[f64; 4]; 4];

/// W with W R W' = I for the markers that are used; the other rows are 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whitener([Features; 4]);

impl Whitener {
    pub fn new(covariance: &Square, [a, b]: [bool; 2]) -> Option<Self> {
        let used = [a, a, b, b];
        // Cholesky's factor F row by row; F W = I.
        let mut factor: Square = [[0.0; 4]; 4];
        let mut whitener: Square = [[0.0; 4]; 4];
        for index in 0..4 {
            if !*used.get(index)? {
                continue;
            }
            let mut row = [0.0; 4];
            for column in 0..=index {
                if !*used.get(column)? {
                    continue;
                }
                let other = if column == index {
                    row
                } else {
                    *factor.get(column)?
                };
                let sum: f64 = row.iter().zip(other).take(column).map(|(x, y)| x * y).sum();
                let rest = covariance.get(index)?.get(column)? - sum;
                *row.get_mut(column)? = if column == index {
                    libm::sqrt(rest)
                } else {
                    rest / other.get(column)?
                };
            }
            let diagonal = *row.get(index)?;
            let mut line: Features = array::from_fn(|entry| if entry == index { 1.0 } else { 0.0 });
            for (by, above) in row.iter().zip(whitener).take(index) {
                for (entry, above) in line.iter_mut().zip(above) {
                    *entry -= by * above;
                }
            }
            let line = line.map(|entry| entry / diagonal);
            if !all_finite(line) {
                return None;
            }
            *factor.get_mut(index)? = row;
            *whitener.get_mut(index)? = line;
        }
        Some(Self(whitener))
    }

    /// For independent features of these standard deviations; a feature of infinite or NaN deviation is not used.
    pub fn independent([a, b, c, d]: Features) -> Self {
        let weight = |std: f64| if std.is_finite() { 1.0 / std } else { 0.0 };
        Self(diagonal([weight(a), weight(b), weight(c), weight(d)]))
    }

    /// W v, in which entries that are not used, and may be NaN, do not count.
    pub fn apply(&self, vector: Features) -> Features {
        self.0.map(|row| {
            row.iter()
                .zip(vector)
                .filter(|(weight, _)| **weight != 0.0)
                .map(|(weight, value)| weight * value)
                .sum()
        })
    }
}

/// A + B.
pub fn add_matrix(matrix: &mut Square, other: &Square) {
    for (row, other) in matrix.iter_mut().zip(other) {
        for (entry, other) in row.iter_mut().zip(other) {
            *entry += other;
        }
    }
}

/// A + v v'.
pub fn add_product(matrix: &mut Square, vector: Features) {
    for (row, own) in matrix.iter_mut().zip(vector) {
        for (entry, other) in row.iter_mut().zip(vector) {
            *entry += own * other;
        }
    }
}

pub fn diagonal(values: Features) -> Square {
    let [a, b, c, d] = values;
    [
        [a, 0.0, 0.0, 0.0],
        [0.0, b, 0.0, 0.0],
        [0.0, 0.0, c, 0.0],
        [0.0, 0.0, 0.0, d],
    ]
}
