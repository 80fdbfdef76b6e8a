//! Small symmetric systems.

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

/// x' M x.
pub fn quadratic<const N: usize>(matrix: &Square<N>, vector: [f64; N]) -> f64 {
    apply(matrix, vector)
        .iter()
        .zip(vector)
        .map(|(a, b)| a * b)
        .sum()
}
