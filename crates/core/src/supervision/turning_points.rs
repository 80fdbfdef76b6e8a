//! Where a signal turns.

/// Follows a signal and tells where it turned, once it has come back by more than `band`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurningPoints {
    band: f64,
    /// 1 upwards, -1 downwards, 0 before either is clear.
    direction: f64,
    /// How far it came in this direction.
    extreme: f64,
    /// Where the last swing began.
    turn: f64,
}

impl TurningPoints {
    /// Before the first value; `band` in the unit of the signal.
    pub const fn new(band: f64) -> Self {
        Self {
            band,
            direction: 0.0,
            extreme: f64::NAN,
            turn: f64::NAN,
        }
    }

    /// 1 while the signal goes up, -1 while it goes down, 0 before that is clear.
    pub const fn direction(&self) -> f64 {
        self.direction
    }

    /// Whether the last value was the farthest in its direction.
    #[allow(clippy::float_cmp)] // it is that value
    pub fn is_farthest(&self, value: f64) -> bool {
        value == self.extreme
    }

    /// The next value; the length of the swing that it shows to be over, if it does.
    pub fn follow(&mut self, value: f64) -> Option<f64> {
        if !value.is_finite() {
            return None;
        }
        if self.extreme.is_nan() {
            (self.extreme, self.turn) = (value, value);
        }
        let back = value - self.extreme;
        if self.direction * back > 0.0 {
            self.extreme = value;
            return None;
        }
        if back.abs() <= self.band {
            return None;
        }
        let swing = (self.extreme - self.turn).abs();
        let is_first = self.direction == 0.0;
        self.direction = 1.0_f64.copysign(back);
        (self.turn, self.extreme) = (self.extreme, value);
        (!is_first).then_some(swing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_turns_twice_a_period_and_noise_within_the_band_never() {
        let mut swings = TurningPoints::new(0.1);
        let mut found = [0.0; 8];
        let mut count = 0;
        for tick in 0..4000 {
            let time = f64::from(tick) * 1e-3;
            let noise = if tick % 2 == 0 { 0.02 } else { -0.02 };
            let value = libm::sin(core::f64::consts::TAU * time) + noise;
            if let Some(swing) = swings.follow(value) {
                found[count] = swing;
                count += 1;
            }
        }
        assert_eq!(count, 8);
        assert!((found[0] - 1.0).abs() < 0.05, "{found:?}");
        for swing in &found[1..] {
            assert!((swing - 2.0).abs() < 0.05, "{found:?}");
        }
    }

    #[test]
    fn what_is_no_number_is_no_turn() {
        let mut swings = TurningPoints::new(0.1);
        assert_eq!(swings.follow(f64::NAN), None);
        for value in [0.0, 1.0, f64::NAN, 2.0] {
            assert_eq!(swings.follow(value), None);
        }
        assert!(swings.direction() > 0.0 && swings.is_farthest(2.0));
        assert_eq!(swings.follow(1.5), Some(2.0));
        assert!(swings.direction() < 0.0 && !swings.is_farthest(2.0));
    }
}
