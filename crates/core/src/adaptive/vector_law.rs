//! Compensation law of profile `best`: the limited gain of Eq. (2) for insertion and rotation together.

use crate::adaptive::lag_lead::LagLead;
use crate::adaptive::offset_rate_limit::OffsetRateLimit;
use crate::adaptive::predicted_tip::PredictedTip;
use crate::adaptive::settings::AdaptiveSettings;
use crate::adaptive::slip_direction::SlipDirection;
use crate::article::play_limit::PlayLimit;
use crate::dof::{PerDof, all_finite};
use crate::error::{ConfigError, require, require_non_negative, require_positive};
use crate::estimation::filter::Filter;
use crate::model::hysteresis::Hysteresis;
use crate::settings::{ControlSettings, DofSettings};

/// Insertion with rotation, and bending: DOFs whose motions are bounded together.
const GROUPS: [PerDof<f64>; 2] = [[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// Share of `command_speed` that the law uses, so that rounding does not exceed it.
const BELOW_LIMIT: f64 = 0.999;
/// Steps in search of the largest motion whose predicted tip is slow enough.
const STEPS: usize = 5;

/// Vector law of limited gain.
///
/// With the reference u, the command c, the estimated hysteresis (half widths h, centres m), the direction w of the
/// operator's motion, and norms over insertion and rotation in units `unit` of each DOF,
///
/// ```text
/// target    c* = u' + m(u') + f h w + (1 - f) h sign(w)         u': output of the plays at which the tip is at u
/// command   dc towards c* - c,   |dc| <= K_b |du|,   dc . du >= 0,   each |dc| <= command_speed period
/// contact   |dq| <= tip_gain |du| for the tip q that the estimate predicts, and q does not pass u along du
/// ```
///
/// of bending by itself; target and contact are those of the reference led by the lag ([`LagLead`]). One DOF alone:
/// 0 <= dc / du <= `K_b`, Eq. (2). Where insertion and rotation rest, neither command moves, but each moves where the other
/// does: while rotation turns, the friction that held the insertion is released.
/// A share of the compensation s makes it dc = du + s (dc - du).
///
/// Wrong as far as the estimate is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VectorLaw {
    free_gain: f64,
    bending_gain: f64,
    tip_gain: f64,
    caution: f64,
    unit: PerDof<f64>,
    /// Largest |dc| in a tick.
    step_limit: PerDof<f64>,
    limits: PerDof<PlayLimit>,
    direction: SlipDirection,
    rate_limit: OffsetRateLimit,
    reference: Option<PerDof<f64>>,
    /// Command less reference.
    lead: PerDof<f64>,
    command: PerDof<f64>,
    share: f64,
    period: f64,
    lag_lead: LagLead,
}

impl VectorLaw {
    /// The law before the first reference, for a shaft of a radius in m; half of `width_limit` (3,) is the unit of the
    /// norms, `command_speed` (3,) the largest speed of the command per s.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        settings: &AdaptiveSettings,
        [insertion, rotation, bending]: &PerDof<DofSettings>,
        control: &ControlSettings,
        width_limit: PerDof<f64>,
        command_speed: PerDof<f64>,
        radius: f64,
        limits: PerDof<PlayLimit>,
    ) -> Result<Self, ConfigError> {
        let gain = |dof: &DofSettings| dof.free_gain.min(dof.gain_limit);
        for dof in [insertion, rotation, bending] {
            let is_gain = dof.free_gain.is_finite() && dof.free_gain >= 1.0;
            require(is_gain, "free_gain", dof.free_gain, "finite, 1 or above")?;
        }
        require(
            settings.tip_gain >= 1.0,
            "tip_gain",
            settings.tip_gain,
            "1 or above",
        )?;
        require_non_negative("caution", settings.caution)?;
        require_non_negative("tremor_time", settings.tremor_time)?;
        require_positive("direction_travel", settings.direction_travel)?;
        require_non_negative("known_travel", settings.known_travel)?;
        for rate in settings.change_rate {
            require_non_negative("change_rate", rate)?;
        }
        let unit = width_limit.map(|width| width / 2.0);
        let mut rate = settings.change_rate;
        for (rate, unit) in rate.iter_mut().zip(unit) {
            *rate *= unit;
        }
        Ok(Self {
            free_gain: gain(insertion).min(gain(rotation)),
            bending_gain: gain(bending),
            tip_gain: settings.tip_gain,
            caution: settings.caution,
            unit,
            step_limit: command_speed.map(|speed| speed * control.period * BELOW_LIMIT),
            limits,
            direction: SlipDirection::new(
                radius,
                unit.map(|unit| settings.direction_travel * unit),
                settings.tremor_time,
                control.period,
            ),
            rate_limit: OffsetRateLimit::new(rate, settings.known_travel, control.period),
            reference: None,
            lead: [0.0; 3],
            command: [f64::NAN; 3],
            share: 1.0,
            period: control.period,
            lag_lead: LagLead::new(unit, control.period),
        })
    }

    /// The command c (3,) [m, rad, rad]; NaN before the first reference.
    pub const fn command(&self) -> PerDof<f64> {
        self.command
    }

    /// The command for the next reference (3,) [m, rad, rad].
    ///
    /// The first reference is passed through. A reference that is not finite moves nothing.
    pub fn propose(&mut self, reference: PerDof<f64>, filter: &Filter) -> PerDof<f64> {
        if !all_finite(reference) {
            return self.command;
        }
        let Some(last) = self.reference.replace(reference) else {
            self.direction.step(reference);
            return reference;
        };
        let motion = subtract(reference, last);
        self.direction.step(reference);
        let mut travel = motion.map(f64::abs);
        for (travel, unit) in travel.iter_mut().zip(self.unit) {
            *travel /= unit;
        }
        self.rate_limit.step(travel);
        self.lag_lead.step(motion);
        let lead = self.next_lead(reference, motion, filter);
        self.lawful(reference, motion, lead)
    }

    /// Continues from the command that was sent (3,) [m, rad, rad]. The filter follows it.
    pub fn commit(&mut self, command: PerDof<f64>, filter: &mut Filter) {
        let before = core::mem::replace(&mut self.command, command);
        let Some(reference) = self.reference else {
            return;
        };
        self.lead = subtract(command, reference);
        if all_finite(before) {
            filter.step(before, command, self.period);
        } else {
            filter.start(reference, command);
        }
    }

    /// Reference plus lead, within the bounds despite rounding; of DOFs that rest the last command, bit for bit.
    fn lawful(
        &self,
        reference: PerDof<f64>,
        motion: PerDof<f64>,
        lead: PerDof<f64>,
    ) -> PerDof<f64> {
        let ([u1, u2, u3], [l1, l2, l3], [c1, c2, c3]) = (reference, lead, self.command);
        let [_, _, du3] = motion;
        let [shaft, _] = GROUPS.map(|group| self.norm(group, motion) > 0.0);
        let [first, second] = if shaft { [u1 + l1, u2 + l2] } else { [c1, c2] };
        // Eq. (2), to the last bit.
        let farthest = c3 + self.bending_gain * du3;
        let third = (u3 + l3).max(c3.min(farthest)).min(c3.max(farthest));
        [first, second, third]
    }

    /// The lead for a reference after its motion.
    fn next_lead(
        &self,
        reference: PerDof<f64>,
        motion: PerDof<f64>,
        filter: &Filter,
    ) -> PerDof<f64> {
        let reference = self.lag_lead.apply(reference, filter.nominal().lag);
        let output = filter.nominal().output(reference);
        let used = self.usable(filter, output);
        let deflection = used.steady_deflection(self.direction.value());
        let mut wanted = output;
        let parts = used.centre.into_iter().zip(deflection).zip(self.command);
        for (wanted, ((centre, deflection), command)) in wanted.iter_mut().zip(parts) {
            *wanted += centre + deflection - command;
        }
        let predicted = PredictedTip::new(filter, self.command);
        let mut lead = self.lead;
        let gains = [self.free_gain, self.bending_gain];
        for (group, gain) in GROUPS.into_iter().zip(gains) {
            let step = self.bounded_step(group, gain, wanted, motion, reference, &predicted);
            let axes = step.into_iter().zip(motion).zip(group);
            // Without gain there is no compensation.
            let share = if gain > 1.0 { self.share } else { 0.0 };
            for (lead, ((step, motion), own)) in lead.iter_mut().zip(axes) {
                *lead += own * share * (step - motion);
            }
        }
        lead
    }

    /// The hysteresis in use where the output is at `output` (3,).
    fn usable(&self, filter: &Filter, output: PerDof<f64>) -> Hysteresis {
        let estimate = Hysteresis {
            centre: filter.centre(output),
            ..filter.nominal().hysteresis
        };
        let mut used = self.rate_limit.apply(&estimate);
        for (half, std) in used.half_width.iter_mut().zip(filter.nominal().width_std) {
            *half *= libm::exp(-self.caution * std);
        }
        let dofs = used.half_width.iter_mut().zip(&mut used.centre);
        for ((half, centre), limit) in dofs.zip(self.limits) {
            let [minus, plus] = limit.clamp(*centre - *half, *centre + *half);
            (*half, *centre) = ((plus - minus) / 2.0, f64::midpoint(minus, plus));
        }
        used
    }

    /// The motion of the commands of a group towards what is wanted, within the bounds.
    fn bounded_step(
        &self,
        group: PerDof<f64>,
        gain: f64,
        wanted: PerDof<f64>,
        motion: PerDof<f64>,
        reference: PerDof<f64>,
        predicted: &PredictedTip,
    ) -> PerDof<f64> {
        let moved = self.norm(group, motion);
        if moved == 0.0 {
            return [0.0; 3];
        }
        let mut step = times(group, wanted);
        // Never against the reference.
        let against = self.product(group, step, motion).min(0.0) / (moved * moved);
        for (step, motion) in step.iter_mut().zip(times(group, motion)) {
            *step -= against * motion;
        }
        let length = self.norm(group, step);
        if length == 0.0 {
            return step;
        }
        let mut share = (gain * moved / length).min(1.0);
        for (step, limit) in step.iter().zip(self.step_limit) {
            share = share.min(limit / step.abs());
        }
        let before = predicted.now();
        let ahead = |tip| self.product(group, subtract(tip, reference), motion) / moved;
        let room = moved.max(-ahead(before));
        for _ in 0..STEPS {
            let mut command = self.command;
            for (command, step) in command.iter_mut().zip(step) {
                *command += share * step;
            }
            let there = predicted.after(command);
            let tip = self.norm(group, subtract(there, before));
            let along = ahead(there) - ahead(before);
            let excess = (tip / (self.tip_gain * moved)).max(along / room);
            if excess <= 1.0 {
                break;
            }
            share *= (1.0 / excess).max(0.2);
        }
        step.map(|step| share * step)
    }

    fn product(&self, group: PerDof<f64>, a: PerDof<f64>, b: PerDof<f64>) -> f64 {
        let units = self.unit.into_iter().zip(group);
        let pairs = a.into_iter().zip(b).zip(units);
        pairs
            .map(|((a, b), (unit, own))| own * (a / unit) * (b / unit))
            .sum()
    }

    fn norm(&self, group: PerDof<f64>, vector: PerDof<f64>) -> f64 {
        libm::sqrt(self.product(group, vector, vector))
    }

    /// Uses this share of the compensation: all with 1, none with 0. Bumpless.
    pub const fn set_share(&mut self, share: f64) {
        self.share = share;
    }

    /// Counts the reference from elsewhere by `shift` (3,); the command stays.
    pub fn shift_reference(&mut self, shift: PerDof<f64>) {
        if let Some(reference) = &mut self.reference {
            for ((reference, lead), shift) in reference.iter_mut().zip(&mut self.lead).zip(shift) {
                *reference += shift;
                *lead -= shift;
            }
            self.direction.shift(shift);
        }
    }

    /// The rate limit of the offsets.
    pub const fn rate_limit_mut(&mut self) -> &mut OffsetRateLimit {
        &mut self.rate_limit
    }
}

fn subtract([a, b, c]: PerDof<f64>, [x, y, z]: PerDof<f64>) -> PerDof<f64> {
    [a - x, b - y, c - z]
}

fn times([a, b, c]: PerDof<f64>, [x, y, z]: PerDof<f64>) -> PerDof<f64> {
    [a * x, b * y, c * z]
}
