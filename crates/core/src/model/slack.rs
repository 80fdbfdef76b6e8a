//! Width, centre and gain of the slack that coefficients of plays make.

use crate::model::plays::{GAIN_ROW, MIDDLE_ROW, Row, Transmission, product};

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
            let gain = product(&GAIN_ROW, row).clamp(GAINS.0, GAINS.1);
            let half = product(&dof.width, row) / gain;
            *slack = Slack {
                half_width: dof.unit * half.max(0.0),
                centre: -dof.unit * product(&MIDDLE_ROW, row) / gain,
                gain,
            };
        }
        found
    }
}
