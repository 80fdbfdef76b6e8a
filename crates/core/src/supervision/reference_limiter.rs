//! Speed limit of the reference: a reference that is too fast is followed at the limit, and lags.

use crate::error::{ConfigError, require, require_positive};
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::settings::SafetySettings;

/// The limited reference stays this share below `command_speed`, or rounding of its increments would exceed it.
const ROUNDING: f64 = 1e-9;

/// Limits the speed of the reference of each DOF.
///
/// The travel of the limited reference in one direction is a leaky sum of its increments dg,
///
/// ```text
/// travel <- k travel + dg,   k = exp(-period / reference_time)
/// |travel| <= reference_speed period / (1 - k)
/// |dg| <= n period command_speed / gain_limit
/// ```
///
/// which a steady `reference_speed` just reaches; a tremor reverses before its travel adds up. n counts the ticks
/// since the input moved last: 1 for a device as fast as the loop, of which the law makes no command faster than
/// `command_speed`.
///
/// Beyond these bounds the rest of an increment du of the input becomes lag. With each increment,
///
/// ```text
/// dg = du + lag, limited to the range from 0 to 2 du and to the bounds above;   lag <- lag + du - dg
/// ```
///
/// so the limited reference moves only while the input moves and in its direction, by at most twice as much. Within the
/// bounds the lag falls by the travel of the input, in either direction: after a reversal the limited reference rests
/// until the input has come back to it. It never travels farther than the input, and where the lag has gone it equals
/// the input again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceLimiter<const N: usize> {
    /// k.
    decay: f64,
    /// `reference_speed` period / (1 - k).
    travel_limit: [f64; N],
    /// period `command_speed` / `gain_limit`.
    step_limit: [f64; N],
    travel: [f64; N],
    /// n.
    ticks: [f64; N],
}

impl<const N: usize> ReferenceLimiter<N> {
    /// The limiter of a reference at rest, for a control period in s.
    ///
    /// # Errors
    /// A time or a speed is not a finite number above 0, or a `gain_limit` is below 1.
    pub fn new(
        safety: &SafetySettings<N>,
        dofs: &[DofSettings; N],
        period: f64,
    ) -> Result<Self, ConfigError> {
        require_positive("period", period)?;
        require_positive("reference_time", safety.reference_time)?;
        let mut step_limit = safety.command_speed;
        for (limit, dof) in step_limit.iter_mut().zip(dofs) {
            let gain = dof.gain_limit;
            let is_gain = gain.is_finite() && gain >= 1.0;
            require(is_gain, "gain_limit", gain, "finite, 1 or above")?;
            *limit *= period / gain * (1.0 - ROUNDING);
            require_positive("command_speed", *limit)?;
        }
        let decay = libm::exp(-period / safety.reference_time);
        let steady = period / (1.0 - decay);
        Ok(Self {
            decay,
            travel_limit: safety.reference_speed.map(|speed| speed * steady),
            step_limit,
            travel: [0.0; N],
            ticks: [0.0; N],
        })
    }

    /// Limit the motion from `last` to `next` (N,) [m or rad], in place.
    ///
    /// The input has moved by `increments` (N,) [m or rad]. Raises `ReferenceFast` where a bound is exceeded.
    pub fn limit(&mut self, next: &mut [f64; N], last: [f64; N], increments: [f64; N]) -> Flags {
        let mut is_fast = false;
        let outputs = next.iter_mut().zip(last).zip(increments);
        let states = self.travel.iter_mut().zip(&mut self.ticks);
        let limits = self.travel_limit.into_iter().zip(self.step_limit);
        for ((((next, last), increment), (travel, ticks)), (travel_limit, step_limit)) in
            outputs.zip(states).zip(limits)
        {
            *travel *= self.decay;
            *ticks += 1.0;
            let with_lag = *next - last;
            let twice = 2.0 * increment;
            let wanted = with_lag.max(twice.min(0.0)).min(twice.max(0.0));
            let reach = step_limit * *ticks;
            if increment.abs() > 0.0 {
                *ticks = 0.0;
            }
            let limited = wanted
                .max(-travel_limit - *travel)
                .min(travel_limit - *travel)
                .max(-reach)
                .min(reach);
            is_fast |= (limited - wanted).abs() > 0.0;
            *travel += limited;
            if (limited - with_lag).abs() > 0.0 {
                *next = last + limited;
            }
        }
        Flags::when(is_fast, Flag::ReferenceFast)
    }

    /// Forget the motion before.
    pub const fn reset(&mut self) {
        (self.travel, self.ticks) = ([0.0; N], [0.0; N]);
    }
}
