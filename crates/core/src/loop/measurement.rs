//! The state estimate from one image, as both profiles provide it.

use crate::article::state::{StateEstimate, found};
use crate::dof::{PerDof, all_finite, zip_with};
use crate::estimation::measurement::Linear;
use crate::model::features::GEOMETRY;

/// Errors of the geometry in profile `best`: those of the model, and of each feature.
pub const ERRORS: usize = GEOMETRY + 4;

/// Linear measurement of the bands of an image.
pub type Bands = Linear<3, 4, ERRORS>;

/// A state estimate from one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// `q_hat`, innovation and which DOFs are observable.
    pub estimate: StateEstimate,
    /// Which markers were used.
    pub used: [bool; 2],
    /// h in px of the state the estimate started from.
    pub predicted_features: [f64; 4],
    /// Standard deviation of each DOF of `q_hat` [m, rad, rad].
    pub state_deviation: PerDof<f64>,
    /// Mahalanobis distance of the innovation.
    pub distance: f64,
    /// The linear measurement, in profile `best`.
    pub bands: Option<Bands>,
}

impl Measurement {
    /// The state of each DOF that the image determined, NaN for the others [m, rad, rad].
    pub(crate) fn observed_state(&self) -> PerDof<f64> {
        let observed = |value, is_observable| if is_observable { value } else { f64::NAN };
        zip_with(self.estimate.state, self.estimate.observable, observed)
    }
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
