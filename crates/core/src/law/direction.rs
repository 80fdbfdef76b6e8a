//! Direction in which the operator moves the tip.

use crate::dof::{Friction, zip_with};

/// Direction of the intended motion: of each friction group a string that the motion of its surface pulls.
///
/// It is a (vector) play of the reference: rate independent. A reversal turns it within a travel of twice the string's length;
/// a tremor, which is shorter, turns it in part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction<const N: usize> {
    friction: Friction<N>,
    /// Largest length of the string of each DOF's group, in the motion of its surface.
    most: [f64; N],
    string: [f64; N],
}

impl<const N: usize> Direction<N> {
    /// At rest, for strings of `travel` in units (N,) of the first DOF of each group.
    pub fn new(friction: Friction<N>, unit: [f64; N], travel: f64) -> Self {
        let surface = zip_with(friction.lever(), unit, |lever, unit| travel * lever * unit);
        let most = friction.group().map(|group| {
            let own = surface.iter().zip(friction.members(group));
            let mut own = own.filter_map(|(surface, own)| own.then_some(*surface));
            own.next().unwrap_or(0.0)
        });
        Self {
            friction,
            most,
            string: [0.0; N],
        }
    }

    /// Follows a motion of the reference (N,) [m or rad].
    pub fn step(&mut self, motion: [f64; N]) {
        let moved = zip_with(self.friction.lever(), motion, |lever, motion| {
            lever * motion
        });
        self.string = zip_with(self.string, moved, |string, moved| string + moved);
        let over = zip_with(self.lengths(), self.most, |length, most| {
            if length > most { most / length } else { 1.0 }
        });
        self.string = zip_with(self.string, over, |string, over| string * over);
    }

    /// The direction (N,): of each group the string over its length, 1 at most.
    pub fn value(&self) -> [f64; N] {
        zip_with(self.string, self.most, |string, most| string / most)
    }

    /// Length of the string of each DOF's group.
    fn lengths(&self) -> [f64; N] {
        let squares = self.string.map(|string| string * string);
        self.friction.sum(squares).map(libm::sqrt)
    }
}
