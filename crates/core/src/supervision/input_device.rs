//! Monitor of the operator's input device: silence, and jumps that no operator makes.

use crate::error::{ConfigError, require_all_positive};
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::settings::SafetySettings;

/// Checks each DOF of the input device's values.
///
/// ```text
/// |du - v T| <= reference_speed T + reference_count         T <= reference_age
/// |du|       <= reference_speed dt + reference_count        T > reference_age
/// ```
///
/// with the increment du of the device's value, the time T for which the value had repeated itself to the bit, its speed
/// v before that, and the time dt of this tick, at least one control period. An input that continues at its speed passes,
/// also from a device that is slower than the loop; so does one at rest that moves by a count, or accelerates from rest.
/// An input that moved while its device was silent does not.
///
/// Minimum-jerk motion (Flash and Hogan 1985), x = d (10 s^3 - 15 s^4 + 6 s^5) over a time D, has an acceleration of at
/// most 5.8 d / D^2: over 20 mm in 0.5 s its increment changes by 12 um in 5 ms; that of a tremor of 1 mm at 12 Hz
/// changes by 0.14 mm.
///
/// Wrong when an input moved by less than these bounds in silence, when a device is late and never catches up, and when
/// a device has a coarser resolution than `reference_count` or gives fewer than about 30 values a second, so that a fast
/// start passes for silence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputDeviceMonitor<const N: usize> {
    period: f64,
    settings: SafetySettings<N>,
    /// v.
    speeds: [f64; N],
    /// T.
    repeated: [f64; N],
}

impl<const N: usize> InputDeviceMonitor<N> {
    /// The monitor of an input at rest, for a control period in s.
    ///
    /// # Errors
    /// A value is not a finite number above 0.
    pub fn new(safety: &SafetySettings<N>, period: f64) -> Result<Self, ConfigError> {
        require_all_positive(&[
            ("period", &[period]),
            ("reference_speed", &safety.reference_speed),
            ("reference_count", &safety.reference_count),
            ("reference_age", &[safety.reference_age]),
        ])?;
        Ok(Self {
            period,
            settings: *safety,
            speeds: [0.0; N],
            repeated: [0.0; N],
        })
    }

    /// Check the increments (N,) [m or rad] of a tick that came `elapsed` in s after the last one.
    ///
    /// Raises `ReferenceLate` after a silence, and `ReferenceJump` out of a motion.
    pub fn update(&mut self, increments: [f64; N], elapsed: f64) -> Flags {
        let elapsed = elapsed.max(self.period);
        let axes = self.speeds.iter_mut().zip(&mut self.repeated);
        let SafetySettings {
            reference_speed,
            reference_count,
            reference_age,
            ..
        } = self.settings;
        let limits = reference_speed.into_iter().zip(reference_count);
        let mut raised = Flags::NONE;
        for (((speed, repeated), increment), (limit, count)) in axes.zip(increments).zip(limits) {
            *repeated += elapsed;
            if increment == 0.0 {
                continue;
            }
            let was_silent = *repeated > reference_age;
            let (expected, time, flag) = if was_silent {
                (0.0, elapsed, Flag::ReferenceLate)
            } else {
                (*speed * *repeated, *repeated, Flag::ReferenceJump)
            };
            let is_beyond = (increment - expected).abs() > limit * time + count;
            raised = raised.union(Flags::when(is_beyond, flag));
            *speed = increment / *repeated;
            *repeated = 0.0;
        }
        raised
    }

    /// Forget the motion before: the next increment is compared with an input at rest.
    pub const fn reset(&mut self) {
        self.speeds = [0.0; N];
        self.repeated = [0.0; N];
    }
}
