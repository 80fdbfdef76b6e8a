//! Turning points of a signal.

/// Detects the turning points of a signal: it has turned once it has come back from its extreme by more than `band`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurningPoints {
    band: f64,
    /// 1 rising, -1 falling, 0 before the signal has moved by `band`.
    direction: f64,
    /// The farthest value in this direction.
    extreme: f64,
    /// The turning point where this swing began.
    turn: f64,
}

impl TurningPoints {
    /// The detector before the first value; `band` is in the unit of the signal.
    pub const fn new(band: f64) -> Self {
        Self {
            band,
            direction: 0.0,
            extreme: f64::NAN,
            turn: f64::NAN,
        }
    }

    /// 1 while the signal rises, -1 while it falls, 0 before it has moved by `band`.
    pub const fn direction(&self) -> f64 {
        self.direction
    }

    /// Whether the last value is the farthest in its direction.
    #[allow(clippy::float_cmp)] // it is the same value
    pub fn is_extreme(&self, value: f64) -> bool {
        value == self.extreme
    }

    /// Update with the next value. Returns the length of the last swing when the signal has turned.
    pub fn update(&mut self, value: f64) -> Option<f64> {
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
        let mut points = TurningPoints::new(0.1);
        let mut found = [0.0; 8];
        let mut count = 0;
        for tick in 0..4000 {
            let time = f64::from(tick) * 1e-3;
            let noise = if tick % 2 == 0 { 0.02 } else { -0.02 };
            let value = libm::sin(core::f64::consts::TAU * time) + noise;
            if let Some(swing) = points.update(value) {
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
    fn values_that_are_not_finite_are_ignored() {
        let mut points = TurningPoints::new(0.1);
        assert_eq!(points.update(f64::NAN), None);
        for value in [0.0, 1.0, f64::NAN, 2.0] {
            assert_eq!(points.update(value), None);
        }
        assert!(points.direction() > 0.0 && points.is_extreme(2.0));
        assert_eq!(points.update(1.5), Some(2.0));
        assert!(points.direction() < 0.0 && !points.is_extreme(2.0));
    }
}
