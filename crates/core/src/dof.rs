//! Degrees of freedom (DOF): values per DOF, and which DOFs share a friction.

use crate::error::{ConfigError, require, require_positive};

/// One value per DOF, always in the order insertion, rotation, bending [m, rad, rad].
pub type PerDof<T> = [T; 3];

/// Friction of N DOFs: DOFs of one group share one friction force.
///
/// A round shaft in its channel, for example: Coulomb friction has one magnitude, along and around the shaft together, so
/// that a rotation releases the friction that holds the insertion (friction ellipse as limit surface: Goyal, Ruina,
/// Papadopoulos, Wear 143, 1991).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction<const N: usize> {
    group: [usize; N],
    lever: [f64; N],
}

impl<const N: usize> Friction<N> {
    /// DOFs of equal number in `group` share a friction; `lever` turns a motion of the DOF into that of the surface that
    /// rubs: 1 for a translation in m, a radius in m for a rotation in rad.
    ///
    /// # Errors
    /// A lever is not a finite number above 0, or a group's number is not below N.
    pub fn new(group: [usize; N], lever: [f64; N]) -> Result<Self, ConfigError> {
        for (group, lever) in group.into_iter().zip(lever) {
            require_positive("lever", lever)?;
            #[expect(clippy::cast_precision_loss, reason = "a small number")]
            require(
                group < N,
                "friction",
                group as f64,
                "below the number of DOFs",
            )?;
        }
        Ok(Self { group, lever })
    }

    /// Every DOF has a friction of its own.
    pub fn independent() -> Self {
        Self {
            group: core::array::from_fn(|dof| dof),
            lever: [1.0; N],
        }
    }

    /// Whether each DOF belongs to a group.
    pub fn members(&self, group: usize) -> [bool; N] {
        self.group.map(|own| own == group)
    }

    /// For each DOF what `combine` makes of the values (N,) of the DOFs of its group, from `start`.
    #[inline]
    pub fn over_group(
        &self,
        values: [f64; N],
        start: f64,
        combine: impl Fn(f64, f64) -> f64,
    ) -> [f64; N] {
        let mut whole = [start; N];
        for (value, group) in values.into_iter().zip(self.group) {
            if let Some(whole) = whole.get_mut(group) {
                *whole = combine(*whole, value);
            }
        }
        self.group
            .map(|group| whole.get(group).copied().unwrap_or(start))
    }

    /// For each DOF the sum of the values (N,) of the DOFs of its group.
    #[inline]
    pub fn sum(&self, values: [f64; N]) -> [f64; N] {
        self.over_group(values, 0.0, |sum, value| sum + value)
    }

    /// Group of each DOF.
    pub const fn group(&self) -> [usize; N] {
        self.group
    }

    /// Lever of each DOF.
    pub const fn lever(&self) -> [f64; N] {
        self.lever
    }
}

/// What `make` makes of each value, or its first error.
///
/// # Errors
/// As `make`; there is no DOF.
pub fn try_each<T: Copy, U: Copy, const N: usize>(
    values: [T; N],
    make: impl Fn(T) -> Result<U, ConfigError>,
) -> Result<[U; N], ConfigError> {
    let Some(first) = values.first() else {
        return Err(ConfigError {
            field: "dof",
            value: 0.0,
            allowed: "one or more",
        });
    };
    let mut made = [make(*first)?; N];
    for (made, value) in made.iter_mut().zip(values).skip(1) {
        *made = make(value)?;
    }
    Ok(made)
}

/// `combine` of each value with that of another array.
pub fn zip_with<T: Copy, U, const N: usize>(
    mut values: [T; N],
    others: [U; N],
    combine: impl Fn(T, U) -> T,
) -> [T; N] {
    for (value, other) in values.iter_mut().zip(others) {
        *value = combine(*value, other);
    }
    values
}

/// Whether every value is a finite number.
pub fn all_finite<const N: usize>(values: [f64; N]) -> bool {
    values.iter().all(|value| value.is_finite())
}
