//! Width, centre and gain of the slack that coefficients of plays make.

use crate::model::plays::{Radii, Row, SHARED, Transmission, gain_row, middle_row, product};

/// Bounds of the gain: outside of them it is another instrument.
pub const GAINS: (f64, f64) = (0.6, 1.3);

/// The slack of a DOF, in its unit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slack {
    /// Half of the width of the backlash.
    pub half_width: f64,
    /// Centre of the contact offsets, command less tip over the gain, from the origin.
    pub centre: f64,
    /// Travel of the tip over that of the command in contact.
    pub gain: f64,
}

impl Slack {
    /// Contact offsets, the lower one first.
    pub fn offsets(&self) -> [f64; 2] {
        [self.centre - self.half_width, self.centre + self.half_width]
    }
}

impl<const N: usize> Transmission<N> {
    /// Slack of each DOF that moves alone, for the coefficients of its plays.
    pub fn slack(&self, rows: &[Row; N]) -> [Slack; N] {
        let mut found = [Slack::default(); N];
        for ((slack, dof), row) in found.iter_mut().zip(self.dofs()).zip(rows) {
            let gain = product(&gain_row(), row).clamp(GAINS.0, GAINS.1);
            let half = product(&dof.width_row(), row) / gain;
            *slack = Slack {
                half_width: dof.unit * half.max(0.0),
                centre: -dof.unit * product(&middle_row(), row) / gain,
                gain,
            };
        }
        found
    }
}

impl Radii {
    /// Coefficients whose sum is the half width times the gain: radius of each play, and of the bent ones with their mean slope.
    pub fn width_row(&self) -> Row {
        let mut row = gain_row();
        let bent = self.all().skip(SHARED).step_by(2);
        let radii = self.all().chain(bent.flat_map(|radius| [radius; 3]));
        row.iter_mut()
            .zip(radii)
            .for_each(|(entry, radius)| *entry *= radius);
        row
    }
}
