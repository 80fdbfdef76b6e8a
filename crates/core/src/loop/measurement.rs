//! The state estimate from one image, as both profiles provide it.

use crate::article::state::{StateEstimate, found};
use crate::dof::{PerDof, all_finite};
use crate::estimation::history::Entry;
use crate::supervision::grip::Sighting;

/// A state estimate with the outputs for the offset estimation.
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
    /// The measured output of each DOF for the estimation of its offsets [m, rad, rad].
    pub output: PerDof<f64>,
    /// Standard deviation of `output` [m, rad, rad].
    pub output_deviation: PerDof<f64>,
}

impl Measurement {
    /// The output of each DOF that the image determined, NaN for the others [m, rad, rad].
    pub(crate) fn observed_output(&self) -> PerDof<f64> {
        let mut state = self.output;
        for (value, observable) in state.iter_mut().zip(self.estimate.observable) {
            if !observable {
                *value = f64::NAN;
            }
        }
        state
    }

    /// Command and measured tip of each DOF, with the offsets that its estimate allows.
    pub(crate) fn sightings(&self, past: &Entry, offsets: PerDof<(f64, f64)>) -> PerDof<Sighting> {
        let [m1, m2, m3] = self.observed_output();
        let [d1, d2, d3] = self.output_deviation;
        let [c1, c2, c3] = past.command;
        let [t1, t2, t3] = past.travel;
        let [o1, o2, o3] = offsets;
        [
            (c1, t1, m1, d1, o1),
            (c2, t2, m2, d2, o2),
            (c3, t3, m3, d3, o3),
        ]
        .map(|(command, travel, tip, deviation, offsets)| Sighting {
            command,
            travel,
            tip,
            deviation,
            offsets,
        })
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
