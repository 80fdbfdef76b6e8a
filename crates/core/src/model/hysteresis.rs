//! Hysteresis of the three DOFs with constant parameters, for simulated instruments.

use crate::dof::PerDof;
use crate::model::friction::slide;

/// Share of the friction below which the DOFs count as independent; the vector play needs a width.
const LEAST_SHARE: f64 = 1e-3;

/// Hysteresis of insertion, rotation and bending.
///
/// ```text
/// shaft:  vector play of (c1 - m1, c2 - m2) with half widths f h     friction that insertion and rotation share
/// output: play of the shaft with half widths (1 - f) h, each DOF by itself; of bending the play of c3 - m3
/// ```
///
/// so that f = 1 is one friction and f = 0 two independent ones. A DOF that moves alone is the play of Eq. (1) with the
/// offsets m - h and m + h.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hysteresis {
    /// h (3,) [m, rad, rad], above 0.
    pub half_width: PerDof<f64>,
    /// m (3,): centre of the contact offsets, input minus output [m, rad, rad].
    pub centre: PerDof<f64>,
    /// f: share of the friction that insertion and rotation have in common, 0 to 1.
    pub shared: f64,
}

/// State of the plays in a [`Hysteresis`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayPosition {
    /// Output of the vector play (2,) [m, rad].
    pub shaft: [f64; 2],
    /// Output of each DOF (3,) [m, rad, rad].
    pub output: PerDof<f64>,
}

impl PlayPosition {
    /// Plays whose outputs are at `output`.
    pub const fn at(output: PerDof<f64>) -> Self {
        let [insertion, rotation, _] = output;
        Self {
            shaft: [insertion, rotation],
            output,
        }
    }
}

impl Hysteresis {
    /// The plays after a straight motion of the command [m, rad, rad]; `radius` is the shaft's, in m.
    ///
    /// Plays outside of their half widths are moved to the nearest position within.
    #[must_use]
    pub fn propagate(
        &self,
        radius: f64,
        position: &PlayPosition,
        from: PerDof<f64>,
        to: PerDof<f64>,
    ) -> PlayPosition {
        let ([h1, h2, h3], [m1, m2, m3]) = (self.half_width, self.centre);
        let ([a1, a2, _], [c1, c2, c3]) = (from, to);
        let share = self.shared.clamp(LEAST_SHARE, 1.0);
        let (s1, s2) = (share * h1, share * h2);
        let [shaft1, shaft2] = position.shaft;
        let (n1, n2) = ((a1 - m1 - shaft1) / s1, (a2 - m2 - shaft2) / s2);
        let length = libm::sqrt(n1 * n1 + n2 * n2).max(1.0);
        let motion = [(c1 - a1) / s1, (c2 - a2) / s2];
        let [n1, n2] = slide([n1 / length, n2 / length], motion, s1 / (radius * s2));
        let shaft = [c1 - m1 - s1 * n1, c2 - m2 - s2 * n2];
        let [shaft1, shaft2] = shaft;
        let [q1, q2, q3] = position.output;
        let (own1, own2) = (h1 - s1, h2 - s2);
        PlayPosition {
            shaft,
            output: [
                q1.max(shaft1 - own1).min(shaft1 + own1),
                q2.max(shaft2 - own2).min(shaft2 + own2),
                q3.max(c3 - m3 - h3).min(c3 - m3 + h3),
            ],
        }
    }
}
