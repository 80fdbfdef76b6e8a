//! Lead of the compensation by the lag of the tip.

use crate::dof::PerDof;

/// Time constant of the velocity of the reference in s.
const VELOCITY_TIME: f64 = 0.02;
/// Largest velocity for which the tip is led, in half of `width_limit` per s.
const LARGEST_VELOCITY: f64 = 2.0;

/// Where the plays have to be for the tip that lags behind them to be at the reference.
///
/// ```text
/// u' = u + lag v         v: du/dt, smoothed over 0.02 s, of each DOF at most 2 halves of `width_limit` per s
/// ```
///
/// A tip that sticks before it slides lags by a distance as well as by a time. Of a motion three times as fast as those
/// from which the lag was learnt, lag v was three times as long as the lag, and the tip went past the end of the motion.
///
/// Wrong for a tip with viscous friction that moves faster: it is behind by the rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LagLead {
    /// Share of a new velocity in the smoothed one.
    new: f64,
    period: f64,
    largest: PerDof<f64>,
    velocity: PerDof<f64>,
}

impl LagLead {
    /// A reference at rest; `unit` (3,) is half of `width_limit`, the control period is in s.
    pub fn new(unit: PerDof<f64>, period: f64) -> Self {
        Self {
            new: period / (VELOCITY_TIME + period),
            period,
            largest: unit.map(|unit| LARGEST_VELOCITY * unit),
            velocity: [0.0; 3],
        }
    }

    /// Update with the motion of the reference in a tick (3,) [m, rad, rad].
    pub fn step(&mut self, motion: PerDof<f64>) {
        for (velocity, motion) in self.velocity.iter_mut().zip(motion) {
            *velocity += self.new * (motion / self.period - *velocity);
        }
    }

    /// u' for a reference u (3,) [m, rad, rad] and a lag (3,) in s.
    pub fn apply(&self, reference: PerDof<f64>, lag: PerDof<f64>) -> PerDof<f64> {
        let mut ahead = reference;
        let led = self.velocity.into_iter().zip(self.largest).zip(lag);
        for (ahead, ((velocity, largest), lag)) in ahead.iter_mut().zip(led) {
            *ahead += lag * velocity.max(-largest).min(largest);
        }
        ahead
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: PerDof<f64> = [6e-3, 1.3, 0.75];
    const LAG: PerDof<f64> = [0.08, 0.05, 0.02];

    fn moving(speed: f64) -> LagLead {
        let mut lead = LagLead::new(UNIT, 0.005);
        for _ in 0..200 {
            lead.step(UNIT.map(|unit| speed * unit * 0.005));
        }
        lead
    }

    #[test]
    fn a_slow_reference_is_led_by_the_lag_and_a_fast_one_by_no_more_than_at_the_largest_velocity() {
        for (speed, led) in [(0.5, 0.5), (-1.9, -1.9), (6.0, 2.0), (-20.0, -2.0)] {
            let found = moving(speed).apply([1.0; 3], LAG);
            for ((found, unit), lag) in found.into_iter().zip(UNIT).zip(LAG) {
                assert!((found - 1.0 - lag * led * unit).abs() < 1e-12, "{speed}");
            }
        }
    }

    /// First-order low pass: the velocity falls to 1/e within its time constant.
    #[test]
    fn a_reference_that_stops_is_led_no_longer() {
        let mut lead = moving(1.0);
        for _ in 0..4 {
            lead.step([0.0; 3]);
        }
        let [found, ..] = lead.apply([0.0; 3], [1.0; 3]);
        let share = found / UNIT[0];
        assert!((share - (1.0_f64 + 0.25).powi(-4)).abs() < 1e-12, "{share}");
    }
}
