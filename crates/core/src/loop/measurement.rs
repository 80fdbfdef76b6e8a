//! A measurement of the tip, as profiles and sensors provide it.

use crate::article::state::found;
use crate::dof::all_finite;

/// A measurement of the state, with what the update of a profile needs of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement<const N: usize, E> {
    /// The most probable state (N,) [m or rad]; a DOF that is not observable has its prediction here.
    pub state: [f64; N],
    /// Which DOFs the measurement determined.
    pub observable: [bool; N],
    /// Mahalanobis distance of the innovation.
    pub distance: f64,
    /// Whether a part of what is measured was missing.
    pub is_partial: bool,
    /// Whether a part of it was left out as an outlier.
    pub has_outlier: bool,
    /// What the profile needs beside them.
    pub evidence: E,
}

/// Whether the vectors from band A to band B of two sets of features (4,) in px differ in direction by more than
/// 120 degrees.
pub fn is_reversed([ua, va, ub, vb]: [f64; 4], [xa, ya, xb, yb]: [f64; 4]) -> bool {
    let (u, v, x, y) = (ub - ua, vb - va, xb - xa, yb - ya);
    let lengths = libm::sqrt((u * u + v * v) * (x * x + y * y));
    u * x + v * y < -0.5 * lengths
}

/// Whether a band was found, and every band found is finite.
pub fn is_usable([ua, va, ub, vb]: [f64; 4]) -> bool {
    let [a, b] = found([ua, va, ub, vb]);
    (a || b) && (!a || all_finite([ua, va])) && (!b || all_finite([ub, vb]))
}
