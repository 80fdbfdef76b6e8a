//! Repeats of a sensor's value.

use crate::supervision::monitors::{SENSORS, VALUES};

/// A value that a sensor repeats bit for bit, and the command since when.
///
/// It is stuck once the command would have changed it by more than any slack takes, until it changes: an encoder without
/// noise repeats its value while the slack is crossed, and until its next count. Blind to a sensor that fails with noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeat<const N: usize> {
    value: f64,
    command: [f64; N],
    is_stuck: bool,
}

impl<const N: usize> Repeat<N> {
    /// Before the first value.
    pub const NEW: Self = Self {
        value: f64::NAN,
        command: [f64::NAN; N],
        is_stuck: false,
    };

    /// Whether a value is stuck, at a command (N,); `is_far` compares with the command since when it repeats.
    pub fn update(
        &mut self,
        value: f64,
        command: [f64; N],
        is_far: impl FnOnce([f64; N]) -> bool,
    ) -> bool {
        if value.to_bits() != self.value.to_bits() {
            (self.value, self.command, self.is_stuck) = (value, command, false);
        } else if !self.is_stuck {
            self.is_stuck = is_far(self.command);
        }
        self.is_stuck
    }
}

/// The values of each sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeats<const N: usize>([[Repeat<N>; VALUES]; SENSORS]);

impl<const N: usize> Default for Repeats<N> {
    fn default() -> Self {
        Self([[Repeat::NEW; VALUES]; SENSORS])
    }
}

impl<const N: usize> Repeats<N> {
    /// Which values of one of the sensors are stuck, at a command (N,); `is_far` compares a value (its index) with what it
    /// was at another command.
    pub fn update(
        &mut self,
        sensor: usize,
        values: &[f64],
        command: [f64; N],
        is_far: impl Fn(usize, [f64; N]) -> bool,
    ) -> [bool; VALUES] {
        let mut stuck = [false; VALUES];
        let repeats = self.0.get_mut(sensor).into_iter().flatten();
        let all = stuck.iter_mut().zip(values).zip(repeats).enumerate();
        for (index, ((stuck, value), repeat)) in all {
            *stuck =
                value.is_finite() && repeat.update(*value, command, |from| is_far(index, from));
        }
        stuck
    }
}
