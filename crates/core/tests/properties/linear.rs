//! Vectors, and linear systems against plain Gaussian elimination.

use crate::math::linear::{
    Matrix, Vector, add, cross, dot, rotate, scale, sinc, sinc_slope, solve_symmetric, square,
};
use proptest::prelude::*;

use super::{close, config};

fn vectors() -> impl Strategy<Value = Vector> {
    prop::array::uniform3(-3.0..3.0)
}

fn symmetric() -> impl Strategy<Value = Matrix> {
    prop::array::uniform6(-3.0..3.0_f64)
        .prop_map(|[a, b, c, d, e, f]| [[a, b, c], [b, d, e], [c, e, f]])
}

/// B B' + 0.1, which is positive definite.
fn positive(rows: Matrix) -> Matrix {
    [0, 1, 2].map(|i| {
        [0, 1, 2].map(|j| {
            let product: f64 = (0..3).map(|k| rows[i][k] * rows[j][k]).sum();
            product + if i == j { 0.1 } else { 0.0 }
        })
    })
}

/// Gaussian elimination with partial pivoting.
pub fn eliminate(mut rows: Matrix, mut right: Vector) -> Vector {
    for column in 0..3 {
        let largest =
            (column..3).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()));
        let pivot = largest.unwrap();
        rows.swap(column, pivot);
        right.swap(column, pivot);
        for row in (0..3).filter(|row| *row != column) {
            let factor = rows[row][column] / rows[column][column];
            let pivot = rows[column];
            for (entry, above) in rows[row].iter_mut().zip(pivot) {
                *entry -= factor * above;
            }
            right[row] -= factor * right[column];
        }
    }
    [0, 1, 2].map(|row| right[row] / rows[row][row])
}

/// Determinants of the leading 1 x 1, 2 x 2 and 3 x 3 parts (Sylvester's criterion).
fn leading_minors(rows: &Matrix) -> Vector {
    let [[a, b, c], [d, e, f], [g, h, i]] = *rows;
    [
        a,
        a * e - b * d,
        a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g),
    ]
}

/// The integral of `f` from 0 to 1 by Simpson's rule.
fn integrate(f: impl Fn(f64) -> f64) -> f64 {
    let steps = 4000_u32;
    let sum: f64 = (0..=steps)
        .map(|step| {
            let weight = match step {
                0 => 1.0,
                last if last == steps => 1.0,
                odd if odd % 2 == 1 => 4.0,
                _ => 2.0,
            };
            weight * f(f64::from(step) / f64::from(steps))
        })
        .sum();
    sum / (3.0 * f64::from(steps))
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn products_and_sums_are_those_of_the_components(a in vectors(), b in vectors(), factor in -3.0..3.0) {
        let inner: f64 = (0..3).map(|k| a[k] * b[k]).sum();
        prop_assert!(close(dot(a, b), inner));
        for k in 0..3 {
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            prop_assert!(close(cross(a, b)[k], a[next] * b[last] - a[last] * b[next]));
            prop_assert!(close(add(a, factor, b)[k], a[k] + factor * b[k]));
            prop_assert!(close(scale(factor, a)[k], factor * a[k]));
        }
        prop_assert!(close(square(factor), factor.powi(2)));
    }

    #[test]
    fn a_matrix_times_a_vector_is_the_sum_of_its_columns(rows in symmetric(), vector in vectors()) {
        let [x, y, z] = vector;
        for (row, product) in rows.iter().zip(rotate(&rows, vector)) {
            prop_assert!(close(product, row[0] * x + row[1] * y + row[2] * z));
        }
    }

    #[test]
    fn sinc_and_its_slope_are_the_integrals_of_cosine_and_sine(x in -20.0..20.0_f64) {
        prop_assert!((sinc(x) - integrate(|t| (x * t).cos())).abs() <= 1e-10);
        prop_assert!((sinc_slope(x) + integrate(|t| t * (x * t).sin())).abs() <= 1e-10);
    }

    #[test]
    fn solutions_agree_with_gaussian_elimination(
        rows in prop::array::uniform3(vectors()), right in vectors()
    ) {
        let matrix = positive(rows);
        let expected = eliminate(matrix, right);
        let size = expected.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
        let solution = solve_symmetric(matrix, right).unwrap();
        for (found, expected) in solution.iter().zip(expected) {
            prop_assert!((found - expected).abs() <= 1e-9 * size, "{} {}", found, expected);
        }
    }

    #[test]
    fn only_positive_definite_matrices_have_a_solution(rows in symmetric()) {
        let minors = leading_minors(&rows);
        prop_assume!(minors.iter().all(|minor| minor.abs() > 1e-6));
        let definite = minors.iter().all(|minor| *minor > 0.0);
        prop_assert_eq!(solve_symmetric(rows, [1.0, 2.0, 3.0]).is_some(), definite);
    }
}

#[test]
fn sinc_is_exact_and_smooth_at_zero() {
    assert_eq!((sinc(0.0), sinc_slope(0.0)), (1.0, 0.0));
    for x in [1e-12, -1e-9, 1e-6] {
        assert!((sinc_slope(x) / (-x / 3.0) - 1.0).abs() <= 1e-12, "{x}");
    }
}

#[test]
fn a_matrix_with_one_axis_that_is_not_positive_has_no_solution() {
    for axis in 0..3 {
        for value in [0.0, -1.0] {
            let mut rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            rows[axis][axis] = value;
            assert_eq!(solve_symmetric(rows, [1.0; 3]), None, "{rows:?}");
        }
    }
}
