//! The prediction that the compensation uses.

use crate::dof::PerDof;
use crate::model::hysteresis::{Hysteresis, PlayPosition};

/// The mean of the ensemble, propagated to now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nominal {
    /// Hysteresis at the present position.
    pub hysteresis: Hysteresis,
    /// Plays.
    pub position: PlayPosition,
    /// Standard deviation of the logarithm of each half width.
    pub width_std: PerDof<f64>,
    /// Travel of the tip over that of the output, about `origin`.
    pub gain: PerDof<f64>,
    /// First reference [m, rad, rad].
    pub origin: PerDof<f64>,
}

impl Nominal {
    /// The tip for an output of the plays (3,) [m, rad, rad].
    pub fn tip(&self, output: PerDof<f64>) -> PerDof<f64> {
        let mut tip = output;
        for ((tip, gain), origin) in tip.iter_mut().zip(self.gain).zip(self.origin) {
            *tip = origin + gain * (*tip - origin);
        }
        tip
    }

    /// The output of the plays for a tip (3,) [m, rad, rad].
    pub fn output(&self, tip: PerDof<f64>) -> PerDof<f64> {
        let mut output = tip;
        for ((output, gain), origin) in output.iter_mut().zip(self.gain).zip(self.origin) {
            *output = origin + (*output - origin) / gain;
        }
        output
    }
}
