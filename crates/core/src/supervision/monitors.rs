//! All that watches the loop, in one place: what comes in, what goes out, what the images say.

use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::dof::PerDof;
use crate::error::{ConfigError, require_positive};
use crate::r#loop::axis::Axis;
use crate::settings::DofSettings;
use crate::supervision::change_watch::{ChangeSettings, ChangeWatch};
use crate::supervision::command_limiter::{CommandLimiter, LimiterResult};
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::frame_gate::{FrameArrival, FrameGate};
use crate::supervision::motion_monitor::MotionMonitor;
use crate::supervision::reactions::{Reaction, Source};
use crate::supervision::reference_gate::ReferenceGate;
use crate::supervision::settings::SafetySettings;
use crate::supervision::supervisor::{Event, Supervisor};

/// How the loop stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supervision {
    /// What is in force.
    pub reaction: Reaction,
    /// Why.
    pub flags: Flags,
    /// What has been wrong since the last acknowledgement.
    pub latched: Flags,
    /// Share of the free gain in use, 0 to 1.
    pub lead: f64,
}

/// The monitors of the loop. While nothing is wrong, they change no bit of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Monitors {
    clutch: ReferenceGate,
    limiters: PerDof<CommandLimiter>,
    pub(crate) frames: FrameGate,
    motion: MotionMonitor,
    changes: ChangeWatch,
    supervisor: Supervisor,
    limits: PerDof<PlayLimit>,
    unit: PerDof<f64>,
    off: Flags,
    time: f64,
    /// The share of the gain that the axes have been told.
    told: f64,
}

impl Monitors {
    /// From their settings, for a control period in s.
    ///
    /// # Errors
    /// One is out of range.
    pub fn new(
        safety: &SafetySettings,
        dofs: &PerDof<DofSettings>,
        period: f64,
    ) -> Result<Self, ConfigError> {
        let [d1, d2, d3] = dofs;
        let [w1, w2, w3] = safety.width_limit;
        let [o1, o2, o3] = safety.offset_limit;
        for width in safety.width_limit {
            require_positive("width_limit", width)?;
        }
        Ok(Self {
            clutch: ReferenceGate::new(safety, period)?,
            limiters: [
                CommandLimiter::new(safety, d1, 0, period)?,
                CommandLimiter::new(safety, d2, 1, period)?,
                CommandLimiter::new(safety, d3, 2, period)?,
            ],
            frames: FrameGate::new(safety, dofs)?,
            motion: MotionMonitor::new(safety, dofs, period)?,
            changes: ChangeWatch::new(ChangeSettings {
                limit: safety.change_limit,
                travel: safety.width_limit.map(|width| safety.change_travel * width),
            })?,
            supervisor: Supervisor::new(safety)?,
            limits: [
                PlayLimit::new(w1, o1)?,
                PlayLimit::new(w2, o2)?,
                PlayLimit::new(w3, o3)?,
            ],
            unit: safety.width_limit,
            off: safety.off,
            time: f64::NAN,
            told: 1.0,
        })
    }

    /// Bounds what the axes may believe.
    pub(crate) fn limit(&self, axes: &mut PerDof<Axis>) {
        if !self.off.contains(Flag::WidthLimit) {
            for (axis, limit) in axes.iter_mut().zip(self.limits) {
                axis.limit(limit);
            }
        }
    }

    /// A control tick: the axes take what is admitted of the reference and command what is permitted.
    pub(crate) fn tick(
        &mut self,
        axes: &mut PerDof<Axis>,
        reference: PerDof<f64>,
        stamp: Option<f64>,
        time: f64,
    ) {
        let held = self.supervisor.reaction() >= Reaction::HoldMotion;
        let admission = self.clutch.step(reference, time, stamp, held, self.off);
        let mut event = Event {
            source: Source::Tick,
            time,
            travel: 0.0,
            raised: admission
                .raised
                .union(self.frames.check_gap(time).difference(self.off)),
            severe: admission.severe,
        };
        for (moved, unit) in admission.increments.iter().zip(self.unit) {
            event.travel += moved.abs() / unit;
        }
        if let Some(reference) = admission.reference {
            let motion = self.motion.update_reference(reference);
            event.raised = event.raised.union(self.watched(motion));
            self.tell(axes);
            self.step(axes, reference, admission.increments, &mut event);
        }
        self.time = time;
        self.supervisor.update(&event);
    }

    /// Where a limit binds, the share of the reference's motion that the command could not follow is thrown away: never
    /// more than the hand moved, which crossing the slack takes for more.
    fn step(
        &mut self,
        axes: &mut PerDof<Axis>,
        reference: PerDof<f64>,
        moved: PerDof<f64>,
        event: &mut Event,
    ) {
        let mut shifts = [0.0; 3];
        let watched = axes.iter_mut().zip(&mut self.limiters).zip(&mut shifts);
        for (((axis, monitor), shift), (reference, moved)) in
            watched.zip(reference.into_iter().zip(moved))
        {
            let (before, predicted_state) = (axis.command(), axis.predicted_state());
            axis.step(reference);
            if self.off.contains(Flag::Monitor) {
                continue;
            }
            let (permitted, verdict) = monitor.limit(reference, axis.command());
            if verdict != LimiterResult::Unchanged {
                let jumps = Flags::when(verdict == LimiterResult::Jump, Flag::CommandJump);
                event.raised = event
                    .raised
                    .union(Flags::of(Flag::Monitor))
                    .union(jumps.difference(self.off));
                if verdict == LimiterResult::Violation {
                    event.severe = event.severe.union(Flags::of(Flag::Monitor));
                }
                if verdict != LimiterResult::LeadLimited {
                    let followed = (permitted - before) / (axis.command() - before);
                    *shift = -moved * (1.0 - followed.clamp(0.0, 1.0));
                    if !shift.is_finite() {
                        *shift = -moved;
                    }
                }
                axis.amend(*shift, permitted, predicted_state);
                monitor.shift_reference(*shift);
            }
        }
        self.clutch.shift(shifts);
    }

    fn tell(&mut self, axes: &mut PerDof<Axis>) {
        let lead = self.supervisor.gain_share();
        if (lead - self.told).abs() > 0.0 {
            self.told = lead;
            for axis in axes {
                axis.set_share(lead);
            }
        }
    }

    /// A frame came: what is wrong with it, as far as that is looked for.
    pub(crate) fn arrive(&mut self, arrival: &FrameArrival) -> Flags {
        if self.supervisor.reaction() == Reaction::Fade {
            self.frames.reset();
        }
        self.frames.check_arrival(arrival).difference(self.off)
    }

    /// What is in the set and looked for.
    pub(crate) const fn watched(&self, flags: Flags) -> Flags {
        flags.difference(self.off)
    }

    /// The reference as far as it was admitted [m, rad, rad].
    pub(crate) fn admitted(&self) -> PerDof<f64> {
        self.clutch.reference()
    }

    /// What an image says of hand and tip.
    pub(crate) fn look(
        &mut self,
        time: f64,
        reference: PerDof<f64>,
        measured: PerDof<f64>,
        play: PerDof<Play>,
    ) -> Flags {
        let flags = self
            .motion
            .update_measurement(time, reference, measured, play);
        self.watched(flags)
    }

    /// What an image changed of the contact offsets, and how far the command had gone when it was captured.
    pub(crate) fn taught(&mut self, changes: PerDof<[f64; 2]>, travel: PerDof<f64>) -> Flags {
        let flags = self.changes.look(changes, travel);
        self.watched(flags)
    }

    /// Whether images may teach.
    pub(crate) fn may_learn(&self) -> bool {
        self.supervisor.reaction() < Reaction::HoldEstimate
    }

    /// All that was wrong with a frame.
    pub(crate) fn judged(&mut self, raised: Flags) {
        self.supervisor.update(&Event {
            source: Source::Frame,
            time: self.time,
            travel: 0.0,
            raised,
            severe: Flags::NONE,
        });
    }

    /// Something only the rig can see.
    pub fn raise(&mut self, flag: Flag) {
        self.supervisor.update(&Event {
            source: Source::Rig,
            time: self.time,
            travel: 0.0,
            raised: Flags::of(flag).difference(self.off),
            severe: Flags::NONE,
        });
    }

    /// The operator goes on: the first increment of the reference is zero.
    pub fn engage(&mut self) {
        self.supervisor.engage();
        self.clutch.engage();
    }

    /// The operator has seen the warnings.
    pub const fn acknowledge(&mut self) {
        self.supervisor.acknowledge();
    }

    /// How the loop stands.
    pub fn supervision(&self) -> Supervision {
        Supervision {
            reaction: self.supervisor.reaction(),
            flags: self.supervisor.flags(),
            latched: self.supervisor.latched(),
            lead: self.supervisor.gain_share(),
        }
    }
}
