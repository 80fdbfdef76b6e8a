//! What the hand means, without its tremor.

/// Brown's double exponential smoothing of a signal: follows a ramp without lag.
///
/// ```text
/// a <- a + k (u - a)     b <- b + k (a - b)     v = 2 a - b,     k = 1 - exp(-period / time)
/// ```
///
/// Of 8 to 12 Hz, a time of 0.15 s lets 26 to 18 % pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoother {
    factor: f64,
    once: f64,
    twice: f64,
}

impl Smoother {
    /// A smoother at rest; a `time` of 0 passes everything.
    pub fn new(time: f64, period: f64) -> Self {
        let factor = if time > 0.0 {
            -libm::expm1(-period / time)
        } else {
            1.0
        };
        Self {
            factor,
            once: f64::NAN,
            twice: f64::NAN,
        }
    }

    /// The signal is from now on counted from elsewhere.
    pub fn shift(&mut self, shift: f64) {
        self.once += shift;
        self.twice += shift;
    }

    /// The smoothed signal at the next tick; the first value is where it starts.
    pub fn step(&mut self, input: f64) -> f64 {
        if self.once.is_nan() {
            (self.once, self.twice) = (input, input);
        }
        self.once += self.factor * (input - self.once);
        self.twice += self.factor * (self.once - self.twice);
        2.0 * self.once - self.twice
    }
}
