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
