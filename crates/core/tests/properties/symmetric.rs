//! Storage of symmetric matrices.

use crate::math::symmetric::Symmetric;

const SIZE: usize = 4;

/// Each entry is row and column of the lower triangle, as decimal digits.
fn numbered() -> Symmetric<10> {
    let mut matrix = Symmetric::zero();
    matrix.update(|row, column, entry| {
        assert!(column <= row && row < SIZE);
        entry + f64::from(u8::try_from(10 * row + column).unwrap())
    });
    matrix
}

#[test]
fn rows_and_columns_may_change_places() {
    let matrix = numbered();
    for row in 0..SIZE {
        for column in 0..=row {
            let expected = f64::from(u8::try_from(10 * row + column).unwrap());
            assert_eq!(matrix.entry(row, column), expected);
            assert_eq!(matrix.entry(column, row), expected);
        }
    }
}

#[test]
fn an_update_receives_the_entry_as_it_was() {
    let mut matrix = numbered();
    matrix.update(|_, _, entry| 2.0 * entry);
    assert_eq!(matrix.entry(3, 2), 64.0);
    assert_eq!(Symmetric::<10>::zero().entry(3, 3), 0.0);
}

#[test]
fn outside_of_the_matrix_entries_are_nan() {
    assert!(numbered().entry(SIZE, 0).is_nan());
    assert!(numbered().entry(0, SIZE).is_nan());
}
