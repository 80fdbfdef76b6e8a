//! The prediction that the compensation uses.

use crate::dof::PerDof;
use crate::model::hysteresis::{Hysteresis, PlayPosition};

/// Least time constant of the velocity in s.
const LEAST_LAG: f64 = 0.02;

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
    /// Lag of the tip behind the plays (3,) in s.
    pub lag: PerDof<f64>,
    /// Velocity of the output with this lag (3,) [m/s, rad/s, rad/s].
    pub velocity: PerDof<f64>,
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

    /// The tip for an output of the plays (3,) [m, rad, rad] that it lags behind.
    pub fn lagging_tip(&self, mut output: PerDof<f64>, lag: PerDof<f64>) -> PerDof<f64> {
        for ((output, lag), velocity) in output.iter_mut().zip(lag).zip(self.velocity) {
            *output -= lag * velocity;
        }
        self.tip(output)
    }

    /// Follows the output `after` a time in s.
    pub fn follow(&mut self, before: PerDof<f64>, after: PerDof<f64>, time: f64) {
        let moved = after.into_iter().zip(before).zip(self.lag);
        for (velocity, ((after, before), lag)) in self.velocity.iter_mut().zip(moved) {
            let kept = libm::exp(-time / lag.max(LEAST_LAG));
            *velocity = kept * *velocity + (1.0 - kept) * (after - before) / time;
        }
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
