//! Reference gate: validates the reference before the law, and clutches it (offset between input and reference).

use crate::dof::{all_finite, zip_with};
use crate::error::{ConfigError, require, require_positive};
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::input_device::InputDeviceMonitor;
use crate::supervision::reference_limiter::ReferenceLimiter;
use crate::supervision::settings::SafetySettings;

/// `late_tick` allows this share more: two stamps of up to 10^6 s differ by a period with an error of 10^-10 s.
const ROUNDING: f64 = 1e-6;

/// Passes the increments of the reference that are recent, finite and on time, at a limited speed.
///
/// ```text
/// gated reference = reference + offset - lag
/// ```
///
/// A discarded increment goes into the offset, so that nothing catches up later. [`ReferenceLimiter`] has the lag.
/// With nothing discarded and no limit reached, the reference passes bit for bit. [`InputDeviceMonitor`] detects jumps:
/// these are discarded, and motion stops.
///
/// Wrong when an input runs away: slower than `reference_speed` it is followed as it is, and faster at the limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceGate<const N: usize> {
    period: f64,
    settings: SafetySettings<N>,
    limiter: ReferenceLimiter<N>,
    device: InputDeviceMonitor<N>,
    offset: [f64; N],
    /// The reference of the last tick, without the offset.
    input: [f64; N],
    /// The gated reference of the last tick.
    output: Option<[f64; N]>,
    time: Option<f64>,
    /// Whether the next reference sets the offset, wherever it is.
    is_engaging: bool,
}

/// A reference that has passed the gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GatedReference<const N: usize> {
    /// What the law follows (N,) [m or rad]; None before the first reference that is finite.
    pub reference: Option<[f64; N]>,
    /// Its increments (N,) [m or rad]; 0 for the first.
    pub increments: [f64; N],
    /// What was wrong.
    pub raised: Flags,
    /// The flags in `raised` that go to their last reaction at once.
    pub severe: Flags,
}

impl<const N: usize> ReferenceGate<N> {
    /// The gate before the first reference, for a control period in s.
    ///
    /// # Errors
    /// A value is not a finite number above 0, `late_tick` is not above 1, or `stall` is below two periods.
    pub fn new(
        safety: &SafetySettings<N>,
        dofs: &[DofSettings; N],
        period: f64,
    ) -> Result<Self, ConfigError> {
        require_positive("period", period)?;
        let (late, stall) = (safety.late_tick, safety.stall);
        let is_late = late.is_finite() && late > 1.0;
        require(is_late, "late_tick", late, "finite, above 1")?;
        let is_long = stall.is_finite() && stall >= 2.0 * period;
        require(is_long, "stall", stall, "finite, at least two periods")?;
        Ok(Self {
            period,
            settings: *safety,
            limiter: ReferenceLimiter::new(safety, dofs, period)?,
            device: InputDeviceMonitor::new(safety, period)?,
            offset: [0.0; N],
            input: [f64::NAN; N],
            output: None,
            time: None,
            is_engaging: false,
        })
    }

    /// Gate the reference of `time` in s, made at `stamp` in s if that is known; while `is_held`, nothing moves.
    ///
    /// The detectors in `off` are switched off.
    pub fn step(
        &mut self,
        reference: [f64; N],
        time: f64,
        stamp: Option<f64>,
        is_held: bool,
        off: Flags,
    ) -> GatedReference<N> {
        let elapsed = self.elapsed(time);
        let (late, severe) = self.check_times(elapsed, time, stamp);
        let invalid = Flags::when(!all_finite(reference), Flag::ReferenceInvalid);
        let (late, severe) = (late.difference(off), severe.difference(off));
        let mut is_stopped = is_held || self.is_engaging || !late.union(severe).is_empty();
        let mut gated = GatedReference {
            reference: self.output,
            increments: [0.0; N],
            raised: late.union(invalid.difference(off)),
            severe,
        };
        if !invalid.is_empty() {
            return gated;
        }
        let Some(last) = self.output else {
            if !is_held {
                self.output = Some(reference);
                gated.reference = self.output;
            }
            self.input = reference;
            return gated;
        };
        let mut next = self.add_offset(reference, last);
        if !is_stopped {
            let increments = zip_with(reference, self.input, |input, before| input - before);
            let wrong = self.device.update(increments, elapsed).difference(off);
            is_stopped = !wrong.is_empty();
            gated.raised = gated.raised.union(wrong);
            if !is_stopped && !off.contains(Flag::ReferenceFast) {
                let fast = self.limiter.limit(&mut next, last, increments);
                gated.raised = gated.raised.union(fast);
            }
        }
        self.input = reference;
        self.is_engaging = false;
        if is_stopped {
            self.limiter.reset();
            self.device.reset();
            self.offset = zip_with(last, reference, |last, input| last - input);
            return gated;
        }
        gated.increments = zip_with(next, last, |next, last| next - last);
        self.output = Some(next);
        gated.reference = self.output;
        gated
    }

    fn add_offset(&self, reference: [f64; N], last: [f64; N]) -> [f64; N] {
        let mut sums = last;
        let inputs = reference.into_iter().zip(self.input).zip(self.offset);
        for (sum, ((input, before), offset)) in sums.iter_mut().zip(inputs) {
            // A reference at rest moves nothing, whatever rounding makes of the offset.
            if (input - before).abs() != 0.0 {
                *sum = if offset == 0.0 { input } else { input + offset };
            }
        }
        sums
    }

    /// The gated reference (N,) [m or rad]; NaN before the first.
    pub fn reference(&self) -> [f64; N] {
        self.output.unwrap_or([f64::NAN; N])
    }

    /// Discard `shift` (N,) [m or rad] of the motion: the part by which the command could not follow.
    pub fn shift(&mut self, shift: [f64; N]) {
        let Some(output) = &mut self.output else {
            return;
        };
        for ((output, offset), shift) in output.iter_mut().zip(&mut self.offset).zip(shift) {
            // Minus zero plus zero is another number.
            if shift != 0.0 {
                *output += shift;
                *offset += shift;
            }
        }
    }

    /// Clutch in at the next reference, however late it comes and wherever it is.
    pub const fn engage(&mut self) {
        self.time = None;
        self.is_engaging = true;
    }

    /// Time since the last tick, in s.
    fn elapsed(&mut self, time: f64) -> f64 {
        let elapsed = self.time.map_or(self.period, |last| time - last);
        if time.is_finite() {
            self.time = Some(time);
        }
        elapsed
    }

    fn check_times(&self, elapsed: f64, time: f64, stamp: Option<f64>) -> (Flags, Flags) {
        let is_late = elapsed > self.settings.late_tick * self.period * (1.0 + ROUNDING);
        let has_jumped = !time.is_finite() || elapsed < 0.0;
        let age = stamp.map_or(0.0, |stamp| (time - stamp).abs());
        let is_old = age.is_nan() || age > self.settings.reference_age;
        let raised = Flags::when(is_late, Flag::LateTick)
            .union(Flags::when(has_jumped, Flag::Clock))
            .union(Flags::when(is_old, Flag::ReferenceLate));
        (
            raised,
            Flags::when(elapsed > self.settings.stall, Flag::LateTick),
        )
    }
}
