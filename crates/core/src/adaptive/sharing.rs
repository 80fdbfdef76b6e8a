//! How much of a DOF's friction is shared with another, told from its offsets alone.

use crate::adaptive::offset_map::Side;
use crate::math::linear::{Matrix, Vector, add, scale, solve_symmetric};

/// Weight that is left of an offset after the next one.
const KEPT: f64 = 0.998;
/// Of what is expected beforehand, over that of an offset: what is lost must spread by more than its root to say much.
const EXPECTED: f64 = 1e-3;
/// What of a friction that is all shared least squares find: `lost` is itself uncertain, which makes less of it.
const FOUND: f64 = 0.75;

/// Offsets in contact, split into a middle m, half a width h, and the share s of the friction that is shared.
///
/// ```text
/// offset = m +- h (1 - s lost)      + at the upper contact, - at the lower
/// argmin over m, h, h s   sum weight ((offset - m -+ h +- h s lost)^2 + 1e-3 (m^2 + (h - h s)^2))
/// shared = s / 0.75, 0 to 1
/// ```
///
/// with lost = 1 - part, what the other DOF takes if all is shared. Old offsets count less with each new one. m and h
/// are not those of the map: that one is learnt with s, and takes for width what a wrong s leaves unexplained. While
/// nothing has told otherwise, all is shared. `lost` is itself uncertain, so least squares find less than there is: 0.75
/// is where all is meant.
///
/// Wrong where offsets differ from place to place as `lost` does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sharing {
    normal: Matrix,
    right: Vector,
    shared: f64,
}

impl Sharing {
    /// Before the first offset.
    pub const fn new() -> Self {
        Self {
            normal: [[0.0; 3]; 3],
            right: [0.0; 3],
            shared: 1.0,
        }
    }

    /// How much is shared, 0 to 1.
    pub const fn shared(&self) -> f64 {
        self.shared
    }

    /// An offset in contact at a side, measured with this variance [m, rad; m^2, rad^2], while `lost` was taken, 0 to 1.
    pub fn learn(&mut self, side: Side, lost: f64, offset: f64, variance: f64) {
        let sign = match side {
            Side::Minus => -1.0,
            Side::Plus => 1.0,
        };
        let row = [1.0, sign, -sign * lost];
        let expected = [
            [EXPECTED, 0.0, 0.0],
            [0.0, EXPECTED, -EXPECTED],
            [0.0, -EXPECTED, EXPECTED],
        ];
        let lines = self.normal.iter_mut().zip(row).zip(expected);
        for ((line, own), expected) in lines {
            let new = add(expected, own, row);
            *line = add(scale(KEPT, *line), 1.0 / variance, new);
        }
        self.right = add(scale(KEPT, self.right), offset / variance, row);
        let found = solve_symmetric(self.normal, self.right)
            .map(|[_, half, taken]| (half, taken / (FOUND * half)))
            .filter(|(_, shared)| shared.is_finite());
        match found {
            Some((half, shared)) if half > 0.0 => self.shared = shared.clamp(0.0, 1.0),
            Some(_) => {}
            // Nothing to share, or too large for sums of squares.
            None => *self = Self::new(),
        }
    }
}

impl Default for Sharing {
    fn default() -> Self {
        Self::new()
    }
}
