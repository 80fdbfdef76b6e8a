//! The prediction that the compensation uses.

use crate::dof::PerDof;
use crate::model::hysteresis::{Hysteresis, PlayPosition};

/// Least time constant of the velocity in s.
const LEAST_LAG: f64 = 0.02;
/// Time in s within which the residual of the tip falls to 1/e.
const RESIDUAL_TIME: f64 = 0.3;

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
    /// Residual of the tip: what the plays leave of it in the last images (3,) [m, rad, rad].
    pub residual: PerDof<f64>,
}

impl Nominal {
    /// The tip for an output of the plays (3,) [m, rad, rad]: origin + gain (output - origin) + residual.
    pub fn tip(&self, output: PerDof<f64>) -> PerDof<f64> {
        let mut tip = output;
        let parts = self.gain.into_iter().zip(self.origin).zip(self.residual);
        for (tip, ((gain, origin), residual)) in tip.iter_mut().zip(parts) {
            *tip = origin + gain * (*tip - origin) + residual;
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

    /// Updates velocity and residual with a motion of the output (3,) from `before` to `after` within a time in s.
    ///
    /// Times that are not above 0, of a clock that stands or is set back, change neither.
    pub fn follow(&mut self, before: PerDof<f64>, after: PerDof<f64>, time: f64) {
        if time.is_nan() || time <= 0.0 {
            return;
        }
        let moved = after.into_iter().zip(before).zip(self.lag);
        for (velocity, ((after, before), lag)) in self.velocity.iter_mut().zip(moved) {
            let kept = libm::exp(-time / lag.max(LEAST_LAG));
            *velocity = kept * *velocity + (1.0 - kept) * (after - before) / time;
        }
        let kept = libm::exp(-time / RESIDUAL_TIME);
        self.residual = self.residual.map(|residual| kept * residual);
    }

    /// The output of the plays for a tip (3,) [m, rad, rad].
    pub fn output(&self, tip: PerDof<f64>) -> PerDof<f64> {
        let mut output = tip;
        let parts = self.gain.into_iter().zip(self.origin).zip(self.residual);
        for (output, ((gain, origin), residual)) in output.iter_mut().zip(parts) {
            *output = origin + (*output - residual - origin) / gain;
        }
        output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving() -> Nominal {
        let start = PlayPosition::at([0.0; 3]);
        let hysteresis = Hysteresis {
            half_width: [1.0; 3],
            centre: [0.0; 3],
            shared: 0.5,
        };
        Nominal {
            hysteresis,
            position: start,
            width_std: [0.0; 3],
            gain: [1.0; 3],
            origin: [0.0; 3],
            lag: [0.1; 3],
            velocity: [1.0, -2.0, 3.0],
            residual: [0.1, 0.2, -0.3],
        }
    }

    #[test]
    fn a_clock_that_stands_or_goes_back_changes_nothing() {
        for time in [0.0, -1.0, f64::NAN] {
            let mut nominal = moving();
            nominal.follow([0.0; 3], [0.0, 1.0, 2.0], time);
            assert_eq!(nominal, moving(), "{time}");
        }
    }

    #[test]
    fn the_output_of_a_tip_is_the_one_that_has_it() {
        let nominal = Nominal {
            gain: [0.6, 1.2, 1.0],
            origin: [3.0, -1.0, 0.5],
            ..moving()
        };
        let tip = [0.4, 5.0, -2.0];
        for (found, value) in nominal.tip(nominal.output(tip)).into_iter().zip(tip) {
            assert!((found - value).abs() < 1e-12, "{found}");
        }
    }

    /// 0.3 s later it is 1/e, in whatever steps.
    #[test]
    fn a_residual_that_no_image_shows_again_decays() {
        let mut nominal = moving();
        for _ in 0..60 {
            nominal.follow([0.0; 3], [0.0; 3], 0.005);
        }
        for (found, value) in nominal.residual.into_iter().zip(moving().residual) {
            assert!((found - value * libm::exp(-1.0)).abs() < 1e-12, "{found}");
        }
    }

    /// A constant velocity v is reached as v (1 - exp(-t / lag)).
    #[test]
    fn the_velocity_follows_with_the_lag() {
        let mut nominal = moving();
        nominal.velocity = [0.0; 3];
        for _ in 0..20 {
            nominal.follow([0.0; 3], [0.01, 0.02, -0.01], 0.005);
        }
        for (found, v) in nominal.velocity.into_iter().zip([2.0, 4.0, -2.0]) {
            assert!(
                (found - v * (1.0 - libm::exp(-1.0))).abs() < 1e-12,
                "{found}"
            );
        }
    }
}
