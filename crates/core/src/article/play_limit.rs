//! Limits of the estimated contact offsets.

use crate::error::{ConfigError, require_positive};

/// Largest width and offset of an estimated play, in the unit of the DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayLimit {
    width: f64,
    offset: f64,
}

impl PlayLimit {
    /// No limit.
    pub const NONE: Self = Self {
        width: f64::INFINITY,
        offset: f64::INFINITY,
    };

    /// A limit of `delta_plus - delta_minus` and of each |delta|.
    ///
    /// # Errors
    /// One is not a finite number above 0.
    pub fn new(width: f64, offset: f64) -> Result<Self, ConfigError> {
        require_positive("width_limit", width)?;
        require_positive("offset_limit", offset)?;
        Ok(Self { width, offset })
    }

    /// Whether an offset, command minus output, is within the limit.
    pub fn allows(&self, offset: f64) -> bool {
        offset.abs() <= self.offset
    }

    /// Whether the offsets or their width exceed the limit.
    pub fn exceeds(&self, minus: f64, plus: f64) -> bool {
        plus - minus > self.width || !self.allows(minus) || !self.allows(plus)
    }

    /// The nearest offsets within the limit: the surplus of a width is taken from both sides equally.
    pub fn clamp(&self, minus: f64, plus: f64) -> [f64; 2] {
        let [minus, plus] = [minus, plus].map(|value| value.max(-self.offset).min(self.offset));
        let surplus = (plus - minus - self.width) / 2.0;
        if surplus > 0.0 {
            [minus + surplus, plus - surplus]
        } else {
            [minus, plus]
        }
    }
}
