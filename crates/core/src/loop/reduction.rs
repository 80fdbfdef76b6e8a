//! The whole loop, Fig. 6.

use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::dof::{Friction, zip_with};
use crate::error::{ConfigError, require};
use crate::estimation::history::{Entry, History};
use crate::r#loop::profile::{BandProfile, Profile};
use crate::r#loop::settings::{LoopSettings, Settings};
use crate::model::features::FeatureModel;
use crate::supervision::command_limiter::CommandLimiters;
use crate::supervision::monitors::{Monitors, SENSORS};

/// Image-based hysteresis reduction, Fig. 6: reference in, command out; measurements update the estimate of the hysteresis.
///
/// `P` is the profile, `Paper` or `Best`; `S` the storage of the latest control ticks, by default of 1.27 s at 5 ms; `V` the
/// configured view of the instrument, or what sensors repeat; N the number of DOFs.
#[derive(Debug, Clone)]
pub struct HysteresisReduction<P, S = [Entry; 256], V = FeatureModel, const N: usize = 3> {
    pub(super) profile: P,
    pub(super) view: V,
    pub(super) history: History<S, N>,
    pub(super) monitors: Monitors<N>,
    /// Time of capture of the last measurement of each sensor that was used.
    pub(super) last_used: [f64; SENSORS],
    /// The last measurement that determined each DOF, the first one before there is one.
    pub(super) determined: [Determined; N],
    /// Travel of each DOF so far [m or rad].
    pub(super) travel: [f64; N],
}

/// A measurement that determined a DOF.
#[derive(Debug, Clone, Copy)]
pub(super) struct Determined {
    /// Travel of the DOF [m or rad] when it was measured, and when the measurement arrived.
    pub at: f64,
    pub arrived: f64,
    pub sensor: usize,
}

impl Determined {
    const NEVER: Self = Self {
        at: f64::NAN,
        arrived: f64::NAN,
        sensor: 0,
    };
}

impl<P: BandProfile, S: AsRef<[Entry]> + AsMut<[Entry]>> HysteresisReduction<P, S> {
    /// A loop at rest, with storage for at least `control.history`, e.g. `[Entry::BLANK; 256]`.
    ///
    /// # Errors
    /// A setting is out of range, or the storage is too small.
    pub fn new(settings: &Settings, storage: S) -> Result<Self, ConfigError> {
        let of_loop = settings.of_loop()?;
        let make = |limits| P::new(&of_loop, limits);
        Self::with_profile(&of_loop, make, settings.feature_model()?, storage)
    }
}

impl<P: Profile<N>, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>, V, const N: usize>
    HysteresisReduction<P, S, V, N>
{
    /// A loop at rest with the profile that `make` makes for limits of the offsets.
    pub(super) fn with_profile(
        settings: &LoopSettings<N>,
        make: impl FnOnce([PlayLimit; N]) -> Result<P, ConfigError>,
        view: V,
        storage: S,
    ) -> Result<Self, ConfigError> {
        let control = &settings.control;
        let age = settings.safety.frame_age;
        let is_known = age <= control.history;
        require(is_known, "frame_age", age, "at most control.history")?;
        let mut dofs = settings.dofs;
        let (friction, gain) = if P::IS_COUPLED {
            // The vector law bounds its commands itself: the reference may be as fast as they.
            for dof in &mut dofs {
                dof.gain_limit = 1.0;
            }
            (settings.friction, [settings.law.free_gain; N])
        } else {
            (Friction::independent(), dofs.map(|dof| dof.gain_limit))
        };
        let limiters = CommandLimiters::new(&settings.safety, gain, control.period, friction)?;
        let monitors = Monitors::new(&settings.safety, &dofs, control.period, limiters)?;
        Ok(Self {
            profile: make(monitors.play_limits())?,
            view,
            history: History::new(control.history, control.period, storage)?,
            monitors,
            last_used: [f64::NEG_INFINITY; SENSORS],
            determined: [Determined::NEVER; N],
            travel: [0.0; N],
        })
    }

    /// Control tick at `time` in s: reference (N,) in, command (N,) out [m or rad].
    ///
    /// `stamp` is the time in s at which the reference was generated, if known. A reference that is not finite
    /// holds the command, which before the first reference is NaN.
    pub fn step(&mut self, reference: [f64; N], stamp: Option<f64>, time: f64) -> [f64; N] {
        self.step_within(reference, stamp, time, |_, command| command)
    }

    /// As [`Self::step`], within limits of the actuators: `limit` has the last command, NaN before the first, and the next
    /// one, and returns the farthest command between them that the actuators can follow.
    pub fn step_within(
        &mut self,
        reference: [f64; N],
        stamp: Option<f64>,
        time: f64,
        limit: impl FnOnce([f64; N], [f64; N]) -> [f64; N],
    ) -> [f64; N] {
        let (command_before, state_before) = (self.profile.command(), self.predicted_state());
        self.monitors
            .step(&mut self.profile, reference, stamp, time, limit);
        let (gated, command) = (self.monitors.reference(), self.profile.command());
        let predicted_state = self.predicted_state();
        let distance = |to: f64, from: f64| (to - from).abs();
        let mut moved = zip_with(command, command_before, distance);
        if P::IS_COUPLED {
            // Where another DOF takes up the friction, a tip moves although its command rests.
            let released = zip_with(predicted_state, state_before, distance);
            moved = zip_with(moved, released, f64::max);
        }
        self.travel = zip_with(self.travel, moved, |travel, moved| {
            travel + if moved.is_finite() { moved } else { 0.0 }
        });
        let clock_went_back = self.history.push(Entry {
            time,
            reference: gated,
            command,
            predicted_state,
            corrected: self.profile.corrected(),
            travel: self.travel,
        });
        if clock_went_back {
            self.last_used = [f64::NEG_INFINITY; SENSORS];
        }
        self.profile.keep_up(&self.history, clock_went_back);
        command
    }

    /// The predicted state q now [m or rad]; NaN before the first reference.
    pub fn predicted_state(&self) -> [f64; N] {
        self.profile.predicted_state()
    }

    /// The estimated play of each DOF now.
    pub fn play(&self) -> [Play; N] {
        self.profile.play()
    }
}
