//! Small symmetric linear systems, and conversions between numbers.

/// A square matrix of N rows.
pub type Square<const N: usize> = [[f64; N]; N];

/// The inverse of a symmetric, positive definite matrix (Gauss-Jordan); None where it is not.
pub fn inverse<const N: usize>(mut matrix: Square<N>) -> Option<Square<N>> {
    let mut inverse = [[0.0; N]; N];
    for (index, row) in inverse.iter_mut().enumerate() {
        row[index] = 1.0;
    }
    for column in 0..N {
        let pivot = matrix[column][column];
        if !(pivot.is_finite() && pivot > 0.0) {
            return None;
        }
        for entry in matrix[column].iter_mut().chain(&mut inverse[column]) {
            *entry /= pivot;
        }
        let (pivot_row, pivot_inverse) = (matrix[column], inverse[column]);
        for row in (0..N).filter(|row| *row != column) {
            let factor = matrix[row][column];
            for index in 0..N {
                matrix[row][index] -= factor * pivot_row[index];
                inverse[row][index] -= factor * pivot_inverse[index];
            }
        }
    }
    Some(inverse)
}

/// `matrix` times `vector`.
pub fn apply<const N: usize>(matrix: &Square<N>, vector: [f64; N]) -> [f64; N] {
    matrix.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
}

/// `one` minus `other`.
pub fn difference(one: [f64; 4], other: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|index| one[index] - other[index])
}

/// u, v of both bands.
pub fn points([ua, va, ub, vb]: [f64; 4]) -> [[f64; 2]; 2] {
    [[ua, va], [ub, vb]]
}

/// x' M x.
pub fn quadratic<const N: usize>(matrix: &Square<N>, vector: [f64; N]) -> f64 {
    apply(matrix, vector)
        .iter()
        .zip(vector)
        .map(|(a, b)| a * b)
        .sum()
}

/// Whether all entries differ by less than a `distance`; not where one is NaN.
pub fn is_near(one: &[f64; 4], other: &[f64; 4], distance: f64) -> bool {
    (one.iter().zip(other)).all(|(one, other)| (one - other).abs() < distance)
}

/// Integer part of a coordinate; 0 for a negative value or NaN.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast from a float saturates; NaN becomes 0"
)]
pub fn floor(value: f64) -> usize {
    value as usize
}

/// A count of pixels along a side of a frame; exact, because a side has at most 2^16.
pub fn real(count: usize) -> f64 {
    u32::try_from(count).map_or(f64::INFINITY, f64::from)
}

/// Single precision, which 8-bit samples do not exceed.
#[expect(
    clippy::cast_possible_truncation,
    reason = "8-bit samples need no more digits"
)]
pub fn single(value: f64) -> f32 {
    value as f32
}

/// A sum over the pixels of a frame.
#[expect(
    clippy::cast_precision_loss,
    reason = "sums over a frame stay far below 2^53"
)]
pub fn real_sum(sum: u64) -> f64 {
    sum as f64
}
