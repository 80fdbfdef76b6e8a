//! The three degrees of freedom (DOF).

/// One value per DOF, always in the order insertion, rotation, bending [m, rad, rad].
pub type PerDof<T> = [T; 3];

/// Whether every value is a finite number.
pub fn all_finite<const N: usize>(values: [f64; N]) -> bool {
    values.iter().all(|value| value.is_finite())
}
