//! Whether a hand can have moved as its device says: not from rest, nor out of its motion, all at once.

use crate::dof::PerDof;
use crate::error::{ConfigError, require_positive};
use crate::supervision::flags::{Flag, Flags};

/// What a hand and its device can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputDeviceSettings {
    /// Control period, in s.
    pub period: f64,
    /// Speed that a hand gains or loses at most while its device says nothing new [m/s, rad/s, rad/s].
    pub speed: PerDof<f64>,
    /// What the device counts in [m, rad, rad].
    pub count: PerDof<f64>,
    /// Longest time between two values of a device that speaks, in s.
    pub silence: f64,
}

/// Watches each DOF of what the hand's device says.
///
/// ```text
/// |du - v T| <= speed T + count         T <= silence
/// |du|       <= speed dt + count        T > silence
/// ```
///
/// with the increment du of the device's value, the time T for which it had repeated itself to the bit, its speed v of
/// before, and the time dt of this tick, a control period at least. A hand that goes on as it did passes, with a device
/// that is slower than the loop as well; so does one that rests, and goes on by a count or from rest. A hand that moved
/// while its device said nothing does not.
///
/// Minimum-jerk motion (Flash and Hogan 1985), x = d (10 s^3 - 15 s^4 + 6 s^5) over a time D, gains 5.8 d / D^2 at most:
/// to 20 mm in 0.5 s it changes its increment by 12 um in 5 ms, and a tremor of 1 mm at 12 Hz by 0.14 mm.
///
/// Wrong about a hand that moved by less than that in silence, or whose device is late and never catches up; and where
/// a device counts more coarsely than `count`, or tells less than some 30 values a second, so that a quick start of the
/// hand passes for silence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputDeviceMonitor {
    settings: InputDeviceSettings,
    /// v.
    speeds: PerDof<f64>,
    /// T.
    repeated: PerDof<f64>,
}

impl InputDeviceMonitor {
    /// Of a hand at rest.
    ///
    /// # Errors
    /// A value is not a finite number above 0.
    pub fn new(settings: InputDeviceSettings) -> Result<Self, ConfigError> {
        require_positive("period", settings.period)?;
        for (field, values) in [
            ("reference_speed", settings.speed),
            ("reference_count", settings.count),
        ] {
            for value in values {
                require_positive(field, value)?;
            }
        }
        require_positive("reference_age", settings.silence)?;
        Ok(Self {
            settings,
            speeds: [0.0; 3],
            repeated: [0.0; 3],
        })
    }

    /// A tick `gap` in s after the last one, in which the device's values moved by `moved` (3,) [m, rad, rad].
    ///
    /// `ReferenceLate` after a silence, `ReferenceJump` out of a motion.
    pub fn tick(&mut self, moved: PerDof<f64>, gap: f64) -> Flags {
        let gap = gap.max(self.settings.period);
        let axes = self.speeds.iter_mut().zip(&mut self.repeated).zip(moved);
        let limits = self.settings.speed.into_iter().zip(self.settings.count);
        let mut raised = Flags::NONE;
        for (((speed, repeated), moved), (limit, count)) in axes.zip(limits) {
            *repeated += gap;
            if moved == 0.0 {
                continue;
            }
            let silent = *repeated > self.settings.silence;
            let (expected, time, flag) = if silent {
                (0.0, gap, Flag::ReferenceLate)
            } else {
                (*speed * *repeated, *repeated, Flag::ReferenceJump)
            };
            let beyond = (moved - expected).abs() > limit * time + count;
            raised = raised.and(Flags::when(beyond, flag));
            *speed = moved / *repeated;
            *repeated = 0.0;
        }
        raised
    }

    /// The hand may have been anywhere, and done anything.
    pub const fn restart(&mut self) {
        self.speeds = [0.0; 3];
        self.repeated = [0.0; 3];
    }
}
