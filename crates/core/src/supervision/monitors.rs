//! Supervision as a wrapper of the laws: what goes in is gated, what comes out is limited.

use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::dof::{all_finite, zip_with};
use crate::error::ConfigError;
use crate::settings::DofSettings;
use crate::supervision::command_limiter::{CommandLimiters, LimiterResult};
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::frame_gate::{FrameArrival, FrameGate};
use crate::supervision::frame_rate::FrameRate;
use crate::supervision::motion_monitor::MotionMonitor;
use crate::supervision::reactions::{Reaction, Source};
use crate::supervision::reference_gate::ReferenceGate;
use crate::supervision::sensor_fit::SensorFit;
use crate::supervision::settings::SafetySettings;
use crate::supervision::start_check::StartCheck;
use crate::supervision::supervisor::{Event, Supervision, Supervisor};

/// Sensors that a loop may have, each with its own rate and delay.
pub const SENSORS: usize = 4;
/// Most values of a measurement.
pub const VALUES: usize = 16;
/// Travel of a DOF, in `width_limit`, in which a measurement should have determined it.
const UNSEEN: f64 = 0.25;

/// The law of N DOFs, as far as supervision wraps it.
pub trait Law<const N: usize> {
    /// The command c (N,) [m or rad]; NaN before the first reference.
    fn command(&self) -> [f64; N];

    /// Control tick: the law's command for the next reference, not yet adopted.
    fn propose(&mut self, reference: [f64; N]) -> [f64; N];

    /// Continue from the command that was sent: the proposed one, as the limiter left it.
    fn commit(&mut self, command: [f64; N]);

    /// Count the reference from elsewhere by `shift` (N,); the command stays.
    fn shift_reference(&mut self, shift: [f64; N]);

    /// Use this share of the compensation: all with 1, none with 0. Bumpless.
    fn set_share(&mut self, share: f64);
}

/// Supervision of the loop: gate(reference) -> law -> limiter(command), and the monitors of frames and motion.
///
/// While no flag is raised, it changes no bit of the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Monitors<const N: usize> {
    gate: ReferenceGate<N>,
    limiters: CommandLimiters<N>,
    /// A gate for each sensor.
    frames: [FrameGate<N>; SENSORS],
    rates: [FrameRate; SENSORS],
    fits: [SensorFit; SENSORS],
    /// The flags that the last measurement of each sensor raised, and when, in s.
    raised: [(Flags, f64); SENSORS],
    motion: MotionMonitor<N>,
    start: StartCheck<N>,
    supervisor: Supervisor<N>,
    play_limits: [PlayLimit; N],
    unit: [f64; N],
    off: Flags,
    time: f64,
    /// When a measurement determined each DOF last, and the time without one after which sensors count as missing, in s.
    last_determined: [[f64; N]; SENSORS],
    gap: f64,
    /// Travel before the first measurement in `width_limit`, up to `UNSEEN`, when it was that long, and how much later the
    /// measurement may come.
    first_travel: f64,
    moved_at: f64,
    first_within: f64,
    /// Share of the compensation that the supervisor allows, as the law uses it, and that the operator has chosen.
    share: f64,
    chosen: f64,
}

impl<const N: usize> Monitors<N> {
    /// Supervision of N DOFs with a control period in s.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        safety: &SafetySettings<N>,
        dofs: &[DofSettings; N],
        period: f64,
        limiters: CommandLimiters<N>,
    ) -> Result<Self, ConfigError> {
        let mut play_limits = [PlayLimit::NONE; N];
        if !safety.off.contains(Flag::WidthLimit) {
            let limits = safety.width_limit.into_iter().zip(safety.offset_limit);
            for (limit, (width, offset)) in play_limits.iter_mut().zip(limits) {
                *limit = PlayLimit::new(width, offset)?;
            }
        }
        Ok(Self {
            gate: ReferenceGate::new(safety, dofs, period)?,
            limiters,
            frames: [FrameGate::new(safety, dofs)?; SENSORS],
            rates: [FrameRate::NEW; SENSORS],
            fits: [SensorFit::NEW; SENSORS],
            raised: [(Flags::NONE, f64::NEG_INFINITY); SENSORS],
            motion: MotionMonitor::new(safety, dofs, period)?,
            start: StartCheck::new(dofs.map(|dof| dof.start_deviation)),
            supervisor: Supervisor::new(safety)?,
            play_limits,
            unit: safety.width_limit,
            off: safety.off,
            time: f64::NAN,
            last_determined: [[f64::NEG_INFINITY; N]; SENSORS],
            gap: safety.frame_gap,
            first_travel: 0.0,
            moved_at: f64::NAN,
            first_within: safety.frame_age + safety.frame_gap,
            share: 1.0,
            chosen: 1.0,
        })
    }

    /// Limits of the estimated offsets.
    pub(crate) const fn play_limits(&self) -> [PlayLimit; N] {
        self.play_limits
    }

    /// A control tick: gate, law, limiter, and the limits of the actuators.
    pub(crate) fn step<L: Law<N>>(
        &mut self,
        law: &mut L,
        reference: [f64; N],
        stamp: Option<f64>,
        time: f64,
        limit: impl FnOnce([f64; N], [f64; N]) -> [f64; N],
    ) {
        let is_held = self.supervisor.now().reaction >= Reaction::HoldMotion;
        let gated = self.gate.step(reference, time, stamp, is_held, self.off);
        let mut event = Event {
            source: Source::Tick,
            time,
            travel: 0.0,
            raised: gated.raised.union(self.check_gap(time)),
            severe: gated.severe,
            open: Flags::NONE,
        };
        for (increment, unit) in gated.increments.iter().zip(self.unit) {
            event.travel += increment.abs() / unit;
        }
        if self.first_travel <= UNSEEN {
            self.first_travel += event.travel;
            self.moved_at = time;
        }
        if let Some(reference) = gated.reference {
            let motion = self.motion.update_reference(reference);
            event.raised = event.raised.union(self.enabled(motion));
            self.set_share(law);
            self.step_law(law, reference, gated.increments, limit, &mut event);
        }
        self.time = time;
        self.supervisor.update(&event);
    }

    /// Step the law within the limiters: propose, limit, commit.
    ///
    /// Where a limit binds, the share of the reference's motion that the command could not follow is discarded: never
    /// more than the reference moved, which crossing the slack takes for more.
    fn step_law<L: Law<N>>(
        &mut self,
        law: &mut L,
        reference: [f64; N],
        increments: [f64; N],
        limit: impl FnOnce([f64; N], [f64; N]) -> [f64; N],
        event: &mut Event,
    ) {
        let before = law.command();
        let proposed = law.propose(reference);
        // Without an answer the command rests; before the first command there is none to rest at.
        let limit = |lawful| match limit(before, lawful) {
            found if all_finite(found) => found,
            _ if all_finite(before) => before,
            _ => lawful,
        };
        if self.off.contains(Flag::Monitor) {
            law.commit(limit(proposed));
            return;
        }
        let (lawful, mut results) = self.limiters.limit(reference, proposed);
        let limited = limit(lawful);
        self.limiters.continue_from(limited, &mut results);
        law.commit(limited);
        let mut shifts = [0.0; N];
        let motions = limited.into_iter().zip(before).zip(proposed);
        let parts = motions.zip(increments.into_iter().zip(results));
        for (shift, (((limited, before), proposed), (increment, result))) in
            shifts.iter_mut().zip(parts)
        {
            match result {
                LimiterResult::Unchanged => continue,
                LimiterResult::LeadLimited => {}
                LimiterResult::Limited | LimiterResult::Jump | LimiterResult::Violation => {
                    let followed = (limited - before) / (proposed - before);
                    let missed = -increment * (1.0 - followed.clamp(0.0, 1.0));
                    *shift = if missed.is_finite() {
                        missed
                    } else {
                        -increment
                    };
                }
            }
            let found = match result {
                LimiterResult::LeadLimited => Flags::of(Flag::WidthLimit),
                LimiterResult::Jump => Flags::of(Flag::Monitor).union(Flags::of(Flag::CommandJump)),
                _ => Flags::of(Flag::Monitor),
            };
            event.raised = event.raised.union(self.enabled(found));
            if result == LimiterResult::Violation {
                event.severe = event.severe.union(Flags::of(Flag::Monitor));
            }
        }
        if results != [LimiterResult::Unchanged; N] {
            law.shift_reference(shifts);
            self.limiters.shift_reference(shifts);
        }
        self.gate.shift(shifts);
    }

    fn set_share<L: Law<N>>(&mut self, law: &mut L) {
        let share = self.supervisor.now().lead;
        if (share - self.share).abs() > 0.0 {
            self.share = share;
            law.set_share(share * self.chosen);
        }
    }

    /// Use this share of the compensation, of which the supervisor allows a share.
    pub(crate) fn choose_share<L: Law<N>>(&mut self, law: &mut L, share: f64) {
        self.chosen = share;
        law.set_share(share * self.supervisor.now().lead);
    }

    /// Check a frame of one of the sensors on its arrival.
    pub(crate) fn check_arrival(&mut self, arrival: &FrameArrival<N>, sensor: usize) -> Flags {
        let gate = self.frames.get_mut(sensor);
        let flags = gate.map_or(Flags::NONE, |gate| gate.check_arrival(arrival));
        self.enabled(flags)
    }

    /// Check whether the frames of one of the sensors come as often as before.
    pub(crate) fn check_rate(&mut self, captured_at: f64, sensor: usize) -> Flags {
        let rate = self.rates.get_mut(sensor);
        let is_other = rate.is_some_and(|rate| rate.update(captured_at));
        self.enabled(Flags::when(is_other, Flag::FrameRate))
    }

    /// Travel of the command (N,) [m or rad] in which what a sensor measures changes; None if that is not checked.
    pub(crate) fn frozen_travel(&self) -> Option<[f64; N]> {
        let [gate, ..] = &self.frames;
        (!self.off.contains(Flag::Frozen)).then_some(gate.frozen_travel)
    }

    /// The variance of one of the sensors over the told one, with the misfit of a measurement of it, if it has any.
    pub(crate) fn fit(&mut self, misfit: Option<f64>, sensor: usize) -> f64 {
        let Some(fit) = self.fits.get_mut(sensor) else {
            return 1.0;
        };
        if let Some(misfit) = misfit {
            fit.update(misfit);
        }
        fit.scale()
    }

    /// Check whether one of the sensors agrees with its model.
    pub(crate) fn check_fit(&self, sensor: usize) -> Flags {
        let is_off = self.fits.get(sensor).is_some_and(SensorFit::is_off);
        self.enabled(Flags::when(is_off, Flag::GeometryOff))
    }

    /// Check the Mahalanobis distance of an innovation.
    pub(crate) fn check_innovation(&self, distance: f64) -> Flags {
        let [gate, ..] = &self.frames;
        gate.check_innovation(distance)
    }

    /// Whether a travel (N,) [m or rad] is so long that a DOF should have been measured meanwhile.
    pub(crate) fn is_far(&self, travel: [f64; N]) -> bool {
        let mut dofs = travel.iter().zip(self.unit);
        dofs.any(|(travel, unit)| *travel > UNSEEN * unit)
    }

    /// A measurement of one of the sensors has determined some of the DOFs (N,).
    pub(crate) fn determine(&mut self, determined: [bool; N], sensor: usize) {
        let dofs = self.last_determined.get_mut(sensor).into_iter().flatten();
        dofs.zip(determined)
            .filter(|(_, is_new)| *is_new)
            .for_each(|(at, _)| *at = self.time);
    }

    /// Whether sensors other than one, if one is given, determine every DOF.
    fn is_determined(&self, time: f64, without: Option<usize>) -> bool {
        let since = time - self.gap;
        let sensors = self.last_determined.iter().enumerate();
        let others = sensors.filter(|(sensor, _)| Some(*sensor) != without);
        let known = others.fold([false; N], |known, (_, dofs)| {
            zip_with(known, *dofs, |known, at| known || at >= since)
        });
        known == [true; N]
    }

    /// Reduces the flags that a measurement of one of the sensors raised to a warning while others determine every DOF.
    pub(crate) fn excuse(&self, raised: Flags, sensor: usize) -> Flags {
        let rest = raised.difference(Flags::OF_A_SENSOR);
        if rest == raised || !self.is_determined(self.time, Some(sensor)) {
            return raised;
        }
        self.enabled(rest.union(Flags::of(Flag::FrameRate)))
    }

    /// A sensor that is missing is only worth a warning while others determine every DOF. The first measurement of all may
    /// come late, but not long after motion began.
    fn check_gap(&mut self, time: f64) -> Flags {
        let has_none = self.frames.iter().all(FrameGate::is_unused);
        let has_moved = self.first_travel > UNSEEN;
        let is_blind = has_none && has_moved && time - self.moved_at > self.first_within;
        let gates = self.frames.iter_mut();
        let found = gates.fold(Flags::when(is_blind, Flag::Dropped), |flags, gate| {
            flags.union(gate.check_gap(time))
        });
        for at in self.last_determined.iter_mut().flatten() {
            *at = at.min(time);
        }
        let is_excused = !found.is_empty() && self.is_determined(time, None);
        self.enabled(if is_excused {
            Flags::of(Flag::FrameRate)
        } else {
            found
        })
    }

    /// The flags of a set whose detectors are not switched off.
    pub(crate) const fn enabled(&self, flags: Flags) -> Flags {
        flags.difference(self.off)
    }

    /// The reference behind the gate (N,) [m or rad]; NaN before the first.
    pub(crate) fn reference(&self) -> [f64; N] {
        self.gate.reference()
    }

    /// Check reference and measured tip (N,) [m or rad] of an image of `time` in s, with the estimated play.
    pub(crate) fn check_motion(
        &mut self,
        time: f64,
        reference: [f64; N],
        measured: [f64; N],
        play: [Play; N],
    ) -> Flags {
        let flags = self
            .motion
            .update_measurement(time, reference, measured, play);
        self.enabled(flags)
    }

    /// The least standard deviations (N,) [m or rad] of the command that tell the directions; None once they are known.
    pub(crate) fn unknown_direction(&self) -> Option<[f64; N]> {
        self.start.unknown()
    }

    /// Check whether the measured tip (N,) [m or rad] moves as the command of its time does.
    pub(crate) fn check_start(&mut self, command: [f64; N], measured: [f64; N]) {
        if self.start.update(command, measured) {
            self.raise(Flag::StartCheck);
        }
    }

    /// Raise a flag of the rig.
    pub fn raise(&mut self, flag: Flag) {
        self.react(Source::Rig, self.enabled(Flags::of(flag)), Flags::NONE);
    }

    /// React to the flags that a measurement of one of the sensors raised.
    pub(crate) fn react_to_measurement(&mut self, raised: Flags, sensor: usize) {
        if let Some(last) = self.raised.get_mut(sensor) {
            *last = (raised, self.time);
        }
        // A good measurement of one sensor does not clear what the last one of another has raised.
        let since = self.time - self.gap;
        let mut open = Flags::NONE;
        for (other, (raised, at)) in self.raised.iter().enumerate() {
            if other != sensor && *at >= since && *at <= self.time {
                open = open.union(*raised);
            }
        }
        self.react(Source::Frame, raised, open);
    }

    /// React to flags between two control ticks.
    fn react(&mut self, source: Source, raised: Flags, open: Flags) {
        self.supervisor.update(&Event {
            source,
            time: self.time,
            travel: 0.0,
            raised,
            severe: Flags::NONE,
            open,
        });
    }

    /// The operator re-engages: the first increment of the reference is zero.
    pub fn engage(&mut self) {
        self.supervisor.engage();
        self.gate.engage();
        self.start.restart();
    }

    /// The operator has seen the warnings.
    pub const fn acknowledge(&mut self) {
        self.supervisor.acknowledge();
    }

    /// State of the supervision now.
    pub const fn supervision(&self) -> Supervision {
        self.supervisor.now()
    }
}
