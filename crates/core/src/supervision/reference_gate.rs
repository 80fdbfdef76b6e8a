//! Between the hand and the law: only fresh, finite increments of the reference, taken in time, move anything.

use crate::dof::{PerDof, all_finite};
use crate::error::{ConfigError, require, require_positive};
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::input_device::{InputDeviceMonitor, InputDeviceSettings};

/// Which increments of the reference are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceGateSettings {
    /// Control period, in s.
    pub period: f64,
    /// Largest speed of the reference over `reference_time` [m/s, rad/s, rad/s].
    pub reference_speed: PerDof<f64>,
    /// Over which a speed counts, in s.
    pub reference_time: f64,
    /// What its device counts in [m, rad, rad].
    pub reference_count: PerDof<f64>,
    /// Oldest reference that moves anything, and longest silence of its device, in s.
    pub reference_age: f64,
    /// Periods from one tick to the next beyond which an increment is thrown away.
    pub late_tick: f64,
    /// Time from one tick to the next beyond which motion stops, in s.
    pub stall: f64,
}

/// Admits increments of the reference.
///
/// ```text
/// admitted = reference + offset
/// ```
///
/// Whatever is thrown away of a motion goes into the offset, so that nothing catches up later. With nothing
/// thrown away the reference passes bit for bit.
///
/// What a reference has gained of late, one way, is
///
/// ```text
/// gained <- k gained + du,   k = exp(-period / reference_time)
/// |gained| <= reference_speed period / (1 - k)
/// ```
///
/// which a steady `reference_speed` just reaches. An increment that would break it is no hand's: it is thrown away,
/// and motion stops. A tremor comes back before it has gained much; a hand that runs away slower than
/// `reference_speed` is followed. Nor is what [`InputDeviceMonitor`] says of a hand whose device was silent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceGate {
    settings: ReferenceGateSettings,
    /// k.
    kept: f64,
    gained: PerDof<f64>,
    device: InputDeviceMonitor,
    offset: PerDof<f64>,
    raw: PerDof<f64>,
    admitted: Option<PerDof<f64>>,
    time: Option<f64>,
    /// Whether the hand may be anywhere: the next reference is where it starts.
    fresh: bool,
}

/// What became of a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GatedReference {
    /// What the law is to follow (3,) [m, rad, rad]; None before the first that is finite.
    pub reference: Option<PerDof<f64>>,
    /// Its increments, 0 for the first.
    pub moved: PerDof<f64>,
    /// What was wrong.
    pub raised: Flags,
    /// What of it stops the motion although its first rung would not.
    pub severe: Flags,
}

impl ReferenceGate {
    /// Before the first reference.
    ///
    /// # Errors
    /// A value is not a finite number above 0, or `late_tick` not above 1.
    pub fn new(settings: ReferenceGateSettings) -> Result<Self, ConfigError> {
        require_positive("period", settings.period)?;
        require_positive("reference_time", settings.reference_time)?;
        let late = settings.late_tick.is_finite() && settings.late_tick > 1.0;
        require(late, "late_tick", settings.late_tick, "finite, above 1")?;
        require_positive("stall", settings.stall)?;
        Ok(Self {
            settings,
            kept: libm::exp(-settings.period / settings.reference_time),
            gained: [0.0; 3],
            device: InputDeviceMonitor::new(InputDeviceSettings {
                period: settings.period,
                speed: settings.reference_speed,
                count: settings.reference_count,
                silence: settings.reference_age,
            })?,
            offset: [0.0; 3],
            raw: [f64::NAN; 3],
            admitted: None,
            time: None,
            fresh: false,
        })
    }

    /// The reference at `time` in s, made at `stamp` in s if that is known; nothing of it moves while `held`.
    ///
    /// What is in `off` is not looked at.
    pub fn admit(
        &mut self,
        reference: PerDof<f64>,
        time: f64,
        stamp: Option<f64>,
        held: bool,
        off: Flags,
    ) -> GatedReference {
        let gap = self.gap(time);
        let (late, severe) = self.punctuality(gap, time, stamp);
        let invalid = Flags::when(!all_finite(reference), Flag::ReferenceInvalid);
        let (wrong, severe) = (late.without(off), severe.without(off));
        let mut stopped = held || self.fresh || !wrong.and(severe).is_empty();
        let mut admission = GatedReference {
            reference: self.admitted,
            moved: [0.0; 3],
            raised: wrong.and(invalid.without(off)),
            severe,
        };
        if !invalid.is_empty() {
            return admission;
        }
        let Some(last) = self.admitted else {
            if !held {
                self.admitted = Some(reference);
                admission.reference = self.admitted;
            }
            self.raw = reference;
            return admission;
        };
        let wanted = self.wanted(reference, last);
        if !stopped {
            let unlike = self
                .unlike_a_hand(reference, wanted, last, gap)
                .without(off);
            admission.raised = admission.raised.and(unlike);
            stopped = !unlike.is_empty();
        }
        self.raw = reference;
        self.fresh = false;
        if stopped {
            self.gained = [0.0; 3];
            self.device.restart();
            for ((offset, last), raw) in self.offset.iter_mut().zip(last).zip(reference) {
                *offset = last - raw;
            }
            return admission;
        }
        for ((moved, wanted), last) in admission.moved.iter_mut().zip(wanted).zip(last) {
            *moved = wanted - last;
        }
        self.admitted = Some(wanted);
        admission.reference = self.admitted;
        admission
    }

    /// What the reference comes to, with all that was thrown away.
    fn wanted(&self, reference: PerDof<f64>, last: PerDof<f64>) -> PerDof<f64> {
        let mut wanted = last;
        let raws = reference.into_iter().zip(self.raw).zip(self.offset);
        for (wanted, ((raw, before), offset)) in wanted.iter_mut().zip(raws) {
            // A hand at rest moves nothing, whatever rounding makes of the offset.
            if (raw - before).abs() != 0.0 {
                *wanted = if offset == 0.0 { raw } else { raw + offset };
            }
        }
        wanted
    }

    /// What no hand does, of this increment and those before it.
    fn unlike_a_hand(
        &mut self,
        reference: PerDof<f64>,
        wanted: PerDof<f64>,
        last: PerDof<f64>,
        gap: f64,
    ) -> Flags {
        let mut moved = reference;
        for (moved, before) in moved.iter_mut().zip(self.raw) {
            *moved -= before;
        }
        let outruns = Flags::when(self.outruns(wanted, last), Flag::ReferenceJump);
        self.device.tick(moved, gap).and(outruns)
    }

    /// Whether a DOF would gain more than a hand can, counting this increment.
    fn outruns(&mut self, wanted: PerDof<f64>, last: PerDof<f64>) -> bool {
        let steady = self.settings.period / (1.0 - self.kept);
        let axes = self.gained.iter_mut().zip(wanted).zip(last);
        let mut outruns = false;
        for (((gained, wanted), last), speed) in axes.zip(self.settings.reference_speed) {
            *gained = self.kept * *gained + (wanted - last);
            outruns |= gained.abs() > speed * steady;
        }
        outruns
    }

    /// The reference as far as it was admitted (3,) [m, rad, rad]; NaN before the first.
    pub fn admitted(&self) -> PerDof<f64> {
        self.admitted.unwrap_or([f64::NAN; 3])
    }

    /// The law was kept from following by `shift` (3,) [m, rad, rad]: that part of the motion is thrown away as well.
    pub fn shift(&mut self, shift: PerDof<f64>) {
        let Some(admitted) = &mut self.admitted else {
            return;
        };
        for ((admitted, offset), shift) in admitted.iter_mut().zip(&mut self.offset).zip(shift) {
            // Minus zero plus zero is another number.
            if shift != 0.0 {
                *admitted += shift;
                *offset += shift;
            }
        }
    }

    /// The next tick may be late, and the hand anywhere.
    pub const fn engage(&mut self) {
        self.time = None;
        self.fresh = true;
    }

    /// Time since the last tick, in s.
    fn gap(&mut self, time: f64) -> f64 {
        let gap = self.time.map_or(self.settings.period, |last| time - last);
        if time.is_finite() {
            self.time = Some(time);
        }
        gap
    }

    fn punctuality(&self, gap: f64, time: f64, stamp: Option<f64>) -> (Flags, Flags) {
        let settings = &self.settings;
        // Clocks that count ticks differ in the last digits.
        let late = gap > settings.late_tick * settings.period * (1.0 + 1e-6);
        let jumped = !time.is_finite() || gap < 0.0;
        let age = stamp.map_or(0.0, |stamp| (time - stamp).abs());
        let old = age.is_nan() || age > settings.reference_age;
        let raised = Flags::when(late, Flag::LateTick)
            .and(Flags::when(jumped, Flag::Clock))
            .and(Flags::when(old, Flag::ReferenceLate));
        (raised, Flags::when(gap > settings.stall, Flag::LateTick))
    }
}
