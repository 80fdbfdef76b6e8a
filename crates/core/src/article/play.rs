//! The hysteresis model: a play (backlash) operator, Eq. (1), Fig. 1.

use crate::error::{ConfigError, require, require_finite};

/// The play operator, Eq. (1): the output lags the input by an offset between two contacts.
///
/// ```text
/// v - delta_plus <= y <= v - delta_minus        y <- clamp(y, v - delta_plus, v - delta_minus)
/// ```
///
/// with input v and output y in any one unit. An offset is input minus output (decision 0001);
/// it may have any sign. The operator is rate independent.
///
/// Wrong when the slack has a rounded, pre-sliding shape (friction spread along a shaft): play
/// has sharp corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Play {
    delta_minus: f64,
    delta_plus: f64,
}

/// The state of a [`Play`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayState {
    /// The output y.
    pub output: f64,
}

impl Play {
    /// A play operator from its contact offsets (input minus output).
    ///
    /// # Errors
    /// An offset is not finite, or `delta_minus` exceeds `delta_plus`.
    pub fn new(delta_minus: f64, delta_plus: f64) -> Result<Self, ConfigError> {
        require_finite("delta_minus", delta_minus)?;
        require_finite("delta_plus", delta_plus)?;
        let ordered = delta_minus <= delta_plus;
        require(ordered, "delta_minus", delta_minus, "at most delta_plus")?;
        Ok(Self {
            delta_minus,
            delta_plus,
        })
    }

    /// A play operator from offsets that the caller has ordered.
    pub(crate) const fn from_ordered(delta_minus: f64, delta_plus: f64) -> Self {
        Self {
            delta_minus,
            delta_plus,
        }
    }

    /// Offset at the negative contact, input minus output.
    pub const fn delta_minus(&self) -> f64 {
        self.delta_minus
    }

    /// Offset at the positive contact, input minus output.
    pub const fn delta_plus(&self) -> f64 {
        self.delta_plus
    }

    /// Travel of the input that moves nothing: `delta_plus - delta_minus`.
    pub fn width(&self) -> f64 {
        self.delta_plus - self.delta_minus
    }

    /// The output for the next input; an input that is not finite leaves it as it is.
    pub fn step(&self, state: &mut PlayState, input: f64) -> f64 {
        if input.is_finite() {
            state.output = state
                .output
                .max(input - self.delta_plus)
                .min(input - self.delta_minus);
        }
        state.output
    }

    /// The nearest position p = v - y that the contacts allow.
    pub(crate) fn clamp(&self, position: f64) -> f64 {
        position.max(self.delta_minus).min(self.delta_plus)
    }
}
