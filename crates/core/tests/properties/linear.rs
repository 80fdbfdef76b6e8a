//! Vectors and matrices.

use crate::math::linear::{
    Matrix, Vector, add, cross, dot, rotate, scale, sinc, sinc_slope, square,
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
}

#[test]
fn sinc_is_exact_and_smooth_at_zero() {
    assert_eq!((sinc(0.0), sinc_slope(0.0)), (1.0, 0.0));
    for x in [1e-12, -1e-9, 1e-6] {
        assert!((sinc_slope(x) / (-x / 3.0) - 1.0).abs() <= 1e-12, "{x}");
    }
}
