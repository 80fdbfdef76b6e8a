//! Motion monitor: tremor, overcompensation, and limit cycles of operator and instrument.

use crate::article::play::Play;
use crate::dof::zip_with;
use crate::error::{ConfigError, require, require_all_positive};
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::settings::SafetySettings;
use crate::supervision::turning_points::TurningPoints;

/// Time constant of the rate of reversals, in s: `tremor_rate` counts those of a second.
const TREMOR_TIME: f64 = 1.0;
/// Time constant of the operator's intended motion, in s: a tremor of 6 to 12 Hz is faster, a voluntary motion slower.
const INTENTION_TIME: f64 = 0.1;

/// Monitors reference and tip of every DOF.
///
/// ```text
/// tremor             s <- s + (u - s) period / 0.1 s,
///                    rate <- exp(-period / 1 s) rate + reversals of u - s where u changes,   rate > tremor_rate
/// overcompensation   d (m - m0) > ahead_ratio d (u - u0)   and
///                    d (m - m0) - d (u - u0) > ahead   and   d (m - u) > ahead,
///                    or d (delta0 - delta) > offset_decrease ahead
/// limit cycle        cycle_swings swings of u and as many of m, each at least cycle_growth times the one before it
/// ```
///
/// with the reference u, its slow part s, the measured tip m, the contact offset delta that the stroke uses, the values
/// u0, m0 and delta0 when the reference turned last, the direction d since then, and ahead = `ahead_limit` `width_limit`. A tremor's
/// swings are at least `tremor_swing` and shorter than `width_limit`; a small one reverses no reference that
/// moves, only what is left without the slow part. While the value of a slow or coarse input device stays the same, the slow
/// part comes back to it: that is no reversal.
///
/// While the slack is crossed, the tip stays behind its reference; it moves farther only if there was less slack than was
/// compensated. The three conditions together exclude a tip that had been left behind before, and a bias of the images.
///
/// Wrong about overcompensation when the images' time stamps are wrong, because the tip is then measured too late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionMonitor<const N: usize> {
    axes: [DofMotion; N],
    /// exp(-period / 1 s).
    decay: f64,
    /// Share by which the slow part follows the reference in a tick.
    follow: f64,
    settings: SafetySettings<N>,
}

impl<const N: usize> MotionMonitor<N> {
    /// The monitor before the first motion, for a control period in s.
    ///
    /// # Errors
    /// A value is not a finite number above 0, or `cycle_swings` is 0.
    pub fn new(
        safety: &SafetySettings<N>,
        dofs: &[DofSettings; N],
        period: f64,
    ) -> Result<Self, ConfigError> {
        let tremor_swing = dofs.map(|dof| dof.update_distance * safety.tremor_swing);
        let turn = dofs.map(|dof| dof.update_distance);
        let ahead = safety.width_limit.map(|width| safety.ahead_limit * width);
        require_all_positive(&[
            ("tremor_swing", &tremor_swing),
            ("width_limit", &safety.width_limit),
            ("update_distance", &turn),
            ("ahead_limit", &ahead),
            ("period", &[period]),
            ("tremor_rate", &[safety.tremor_rate]),
            ("ahead_ratio", &[safety.ahead_ratio]),
            ("offset_decrease", &[safety.offset_decrease]),
            ("cycle_growth", &[safety.cycle_growth]),
            ("cycle_time", &[safety.cycle_time]),
        ])?;
        let swings = safety.cycle_swings;
        require(swings > 0, "cycle_swings", f64::from(swings), "1 or above")?;
        let axes = dofs.map(|dof| DofMotion::new(&dof, safety.tremor_swing));
        Ok(Self {
            axes: zip_with(axes, ahead, |axis, ahead| DofMotion { ahead, ..axis }),
            decay: libm::exp(-period / TREMOR_TIME),
            follow: (period / INTENTION_TIME).min(1.0),
            settings: *safety,
        })
    }

    /// Update with the gated reference of a control tick.
    pub fn update_reference(&mut self, reference: [f64; N]) -> Flags {
        let mut is_tremor = false;
        let dofs = self.axes.iter_mut().zip(reference);
        for ((axis, reference), width) in dofs.zip(self.settings.width_limit) {
            axis.reversals *= self.decay;
            let slow = axis.slow.get_or_insert(reference);
            let fast = reference - *slow;
            *slow += self.follow * fast;
            let last = core::mem::replace(&mut axis.input, reference);
            if reference - last != 0.0 {
                let swing = axis.shake.update(fast);
                axis.reversals += f64::from(swing.is_some_and(|swing| swing < width));
            }
            is_tremor |= axis.reversals > self.settings.tremor_rate;
        }
        Flags::when(is_tremor, Flag::Tremor)
    }

    /// Update with an image of `time` in s: the reference then, the measured tip, NaN where it was not measured, and the
    /// estimated play.
    pub fn update_measurement(
        &mut self,
        time: f64,
        reference: [f64; N],
        measured: [f64; N],
        play: [Play; N],
    ) -> Flags {
        let (mut is_ahead, mut cycles) = (false, false);
        let signals = reference.into_iter().zip(measured).zip(play);
        for (axis, ((reference, measured), play)) in self.axes.iter_mut().zip(signals) {
            if reference.is_finite() && measured.is_finite() {
                is_ahead |= axis.update(time, reference, measured, play, &self.settings);
                let most = self.settings.cycle_swings;
                cycles |= axis.growing.iter().all(|each| each.count >= most);
            }
        }
        Flags::when(is_ahead, Flag::Overcompensation).union(Flags::when(cycles, Flag::LimitCycle))
    }
}

/// Motion of one DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
struct DofMotion {
    ahead: f64,
    /// The last reference, its slow part, and the turning points of the rest where the reference changes.
    input: f64,
    slow: Option<f64>,
    shake: TurningPoints,
    reversals: f64,
    /// Turning points of the reference and of the tip, by every image.
    reference: TurningPoints,
    tip: TurningPoints,
    /// Reference and tip at the extreme of the reference in this stroke, and of the last one.
    extreme: (f64, f64),
    start: Option<(f64, f64)>,
    /// The estimated play when the reference turned last.
    start_play: Option<Play>,
    /// Swings of reference and tip.
    growing: [GrowingSwings; 2],
}

impl DofMotion {
    const fn new(dof: &DofSettings, tremor_swing: f64) -> Self {
        let still = GrowingSwings {
            count: 0,
            swing: f64::INFINITY,
            time: f64::NAN,
        };
        Self {
            ahead: f64::NAN,
            input: f64::NAN,
            slow: None,
            shake: TurningPoints::new(dof.update_distance * tremor_swing),
            reversals: 0.0,
            reference: TurningPoints::new(dof.update_distance),
            tip: TurningPoints::new(dof.update_distance),
            extreme: (f64::NAN, f64::NAN),
            start: None,
            start_play: None,
            growing: [still; 2],
        }
    }

    /// Whether the tip has overtaken its reference, or the offset in use has decreased, in this stroke.
    fn update<const N: usize>(
        &mut self,
        time: f64,
        reference: f64,
        measured: f64,
        play: Play,
        limits: &SafetySettings<N>,
    ) -> bool {
        let [of_reference, of_tip] = &mut self.growing;
        if let Some(swing) = self.reference.update(reference) {
            of_reference.update(time, swing, limits);
            self.start = Some(self.extreme);
            self.start_play = Some(play);
        }
        if let Some(swing) = self.tip.update(measured) {
            of_tip.update(time, swing, limits);
        }
        if self.reference.is_extreme(reference) {
            self.extreme = (reference, measured);
        }
        let direction = self.reference.direction();
        let has_overtaken = self.start.is_some_and(|(reference0, measured0)| {
            let (travel, tip) = (reference - reference0, measured - measured0);
            direction * tip > limits.ahead_ratio * direction * travel
                && direction * (measured - reference) > self.ahead
                && direction * (tip - travel) > self.ahead
        });
        let decrease = self.start_play.map_or(0.0, |start| {
            if direction > 0.0 {
                start.delta_plus() - play.delta_plus()
            } else {
                play.delta_minus() - start.delta_minus()
            }
        });
        has_overtaken || decrease > limits.offset_decrease * self.ahead
    }
}

/// Count of swings in a row that have grown.
#[derive(Debug, Clone, Copy, PartialEq)]
struct GrowingSwings {
    count: u32,
    swing: f64,
    time: f64,
}

impl GrowingSwings {
    fn update<const N: usize>(&mut self, time: f64, swing: f64, limits: &SafetySettings<N>) {
        let grows =
            time - self.time <= limits.cycle_time && swing >= limits.cycle_growth * self.swing;
        self.count = if grows {
            self.count.saturating_add(1)
        } else {
            0
        };
        (self.swing, self.time) = (swing, time);
    }
}
