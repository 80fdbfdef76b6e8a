//! Direction in which the operator moves the tip.

use crate::dof::Friction;

/// Direction of the intended motion: of each friction group a string that the motion of its surface pulls.
///
/// It is a (vector) play of the reference: rate independent. A reversal turns it within a travel of twice the string's length;
/// a tremor, which is shorter, turns it in part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction<const N: usize> {
    friction: Friction<N>,
    /// Length of the string of each group, in the motion of its surface.
    length: [f64; N],
    string: [f64; N],
}

impl<const N: usize> Direction<N> {
    /// At rest, for strings of `travel` in units (N,) of the first DOF of each group.
    pub fn new(friction: Friction<N>, unit: [f64; N], travel: f64) -> Self {
        let mut length = [0.0; N];
        for (group, length) in length.iter_mut().enumerate() {
            let dofs = friction
                .members(group)
                .into_iter()
                .zip(friction.lever())
                .zip(unit);
            let first = dofs.into_iter().find(|((own, _), _)| *own);
            *length = first.map_or(0.0, |((_, lever), unit)| travel * lever * unit);
        }
        Self {
            friction,
            length,
            string: [0.0; N],
        }
    }

    /// Follows a motion of the reference (N,) [m or rad].
    pub fn step(&mut self, motion: [f64; N]) {
        let moved = motion.into_iter().zip(self.friction.lever());
        for (string, (motion, lever)) in self.string.iter_mut().zip(moved) {
            *string += lever * motion;
        }
        for (group, most) in self.length.into_iter().enumerate() {
            let members = self.friction.members(group);
            let length = norm(&self.string, members);
            if length > most {
                let own = self.string.iter_mut().zip(members).filter(|(_, own)| *own);
                own.for_each(|(string, _)| *string *= most / length);
            }
        }
    }

    /// The direction (N,): of each group the string over its length, 1 at most.
    pub fn value(&self) -> [f64; N] {
        let mut value = self.string;
        for (group, length) in self.length.into_iter().enumerate() {
            let members = self.friction.members(group);
            let own = value.iter_mut().zip(members).filter(|(_, own)| *own);
            own.for_each(|(value, _)| *value /= length);
        }
        value
    }
}

fn norm<const N: usize>(vector: &[f64; N], members: [bool; N]) -> f64 {
    let own = vector.iter().zip(members).filter(|(_, own)| *own);
    libm::sqrt(own.map(|(value, _)| value * value).sum())
}
