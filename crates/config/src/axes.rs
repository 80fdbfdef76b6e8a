//! The loop of the degrees of freedom of `[[dof]]`.
//!
//! The only place with the ratios by which the settings of a degree of freedom follow from its `width_limit`.

use serde::Deserialize;
use tautscope_core as core;

use crate::any_loop::{AnyLoop, Profile, entries};

// The article's instrument has about these ratios of its lengths to safety.width_limit.
/// Largest absolute value of a contact offset, in `width_limit`.
pub const OFFSET_LIMIT: f64 = 2.0 / 3.0;
/// An estimate at a limit may be an initial offset.
pub(crate) const ROUNDING: f64 = 1.0 + 1e-9;
const EXPECTED_WIDTH: f64 = 2.0 / 3.0;
const START_DEVIATION: f64 = 0.3;
const UPDATES: f64 = 50.0;
const COUNTS: f64 = 250.0;
/// `speed` without a value, in `width_limit` per s.
pub const SPEED: f64 = 2.0;
/// Largest `command_speed`, over `gain_limit` times `speed`.
const COMMAND_SPEED: f64 = 2.0;
/// Widest `range`, in `width_limit`, and without a value that about 0.
pub const MOST_RANGE: f64 = 100.0;

const STACK: usize = 16 << 20;

/// An entry of `[[dof]]`: names, units and meaning are those of `python/tautscope/config/axes.py`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[expect(missing_docs, reason = "in Python")]
pub struct AxisSettings {
    pub width_limit: f64,
    pub range: Option<(f64, f64)>,
    pub speed: Option<f64>,
    pub friction: String,
    pub lever: f64,
    pub expected_width: Option<f64>,
    pub gain_limit: f64,
    pub command_speed: Option<f64>,
    pub delta_minus: f64,
    pub delta_plus: f64,
}

/// The sections of a configuration that such a loop reads.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct AxesSettings {
    /// The degrees of freedom in the order of every array.
    pub dof: Vec<AxisSettings>,
    /// The loop's clock.
    pub control: core::ControlSettings,
    /// Supervision; its values per degree of freedom are not used.
    pub safety: core::SafetySettings,
    /// Compensation.
    pub law: core::LawSettings,
    /// Estimation.
    pub estimation: core::EstimateSettings,
    /// The scheme of compensation and estimation.
    pub profile: Profile,
    /// Defaults of a degree of freedom that are no lengths.
    pub insertion: core::DofSettings,
}

type Axes<P, const N: usize> =
    core::HysteresisReduction<P, Vec<core::Entry<N>>, core::Repeats<N>, N>;
type PaperOf<const N: usize> = core::Paper<N, core::StateFromSensor<N>>;
type BestOf<const N: usize, const D: usize> = core::Best<N, N, 0, D>;

impl AxesSettings {
    /// A loop at rest; without compensation every gain is 1.
    ///
    /// # Errors
    /// There are not 1 to 8 degrees of freedom, or a setting is out of range.
    pub fn build(&self, compensate: bool) -> Result<AnyLoop, core::ConfigError> {
        // The constructors copy a loop of eight, 0.4 MB, several times: more than the stack of many threads.
        std::thread::scope(|scope| {
            let roomy = std::thread::Builder::new().stack_size(STACK);
            match roomy.spawn_scoped(scope, || self.build_here(compensate)) {
                Ok(thread) => thread
                    .join()
                    .unwrap_or_else(|cause| std::panic::resume_unwind(cause)),
                Err(_) => self.build_here(compensate),
            }
        })
    }

    fn build_here(&self, compensate: bool) -> Result<AnyLoop, core::ConfigError> {
        macro_rules! of {
            ($($count:literal)*) => {
                match self.dof.len() {
                    $($count => self.build_of::<$count, { $count * core::COEFFICIENTS }>(compensate),)*
                    #[expect(clippy::cast_precision_loss, reason = "for the message")]
                    count => Err(error("dof", count as f64, "1 to 8 degrees of freedom")),
                }
            };
        }
        of!(1 2 3 4 5 6 7 8)
    }

    fn build_of<const N: usize, const D: usize>(
        &self,
        compensate: bool,
    ) -> Result<AnyLoop, core::ConfigError> {
        let period = self.control.period;
        if !(period.is_finite() && period > 0.0) {
            return Err(error("period", period, "a finite number above 0"));
        }
        let settings = self.of_loop::<N>(compensate)?;
        let storage = vec![core::Entry::<N>::BLANK; entries(&self.control)?];
        Ok(AnyLoop::Axes(match self.profile {
            Profile::Paper => Box::new(Axes::<PaperOf<N>, N>::of_axes(&settings, storage)?),
            Profile::Best => Box::new(Axes::<BestOf<N, D>, N>::of_axes(&settings, storage)?),
        }))
    }

    fn of_loop<const N: usize>(
        &self,
        compensate: bool,
    ) -> Result<core::LoopSettings<N>, core::ConfigError> {
        let dofs: [&AxisSettings; N] = std::array::from_fn(|index| &self.dof[index]);
        for dof in dofs {
            dof.check(false, &self.safety)?;
        }
        let group = std::array::from_fn(|index| {
            let same = |other: &&AxisSettings| other.friction == dofs[index].friction;
            let first = dofs.iter().position(same).unwrap_or(index);
            if dofs[index].friction.is_empty() {
                index
            } else {
                first
            }
        });
        Ok(core::LoopSettings {
            dofs: dofs.map(|dof| {
                let gain = if compensate { dof.gain_limit } else { 1.0 };
                dof.settings(&self.insertion, gain)
            }),
            friction: core::Friction::new(group, dofs.map(|dof| dof.lever))?,
            control: self.control,
            safety: self.safety_of(dofs),
            law: if compensate {
                self.law
            } else {
                core::LawSettings {
                    free_gain: 1.0,
                    ..self.law
                }
            },
            estimation: self.estimation,
        })
    }

    fn safety_of<const N: usize>(&self, dofs: [&AxisSettings; N]) -> core::SafetySettings<N> {
        macro_rules! with {
            ($($own:ident: $value:expr,)* $(; $kept:ident)*) => {
                core::SafetySettings { $($own: $value,)* $($kept: self.safety.$kept,)* }
            };
        }
        with! {
            width_limit: dofs.map(|dof| dof.width_limit),
            offset_limit: dofs.map(|dof| OFFSET_LIMIT * dof.width_limit),
            reference_speed: dofs.map(AxisSettings::speed),
            command_speed: dofs.map(AxisSettings::command_speed),
            command_travel: dofs.map(|dof| {
                let far = MOST_RANGE / 2.0 * dof.width_limit;
                dof.range.unwrap_or((-far, far))
            }),
            reference_count: dofs.map(|dof| dof.width_limit / COUNTS),
            // An encoder repeats its value bit for bit while the slack is crossed, and until its next count.
            frozen_travel: 1.5 * UPDATES,
            ; off; reference_time; reference_age; late_tick; stall; frame_age; frame_gap; clock_jump; innovation_limit
            ; tremor_swing; tremor_rate; ahead_limit; ahead_ratio; offset_decrease; cycle_swings; cycle_growth; cycle_time
            ; hold_time; hold_travel; fade_travel; restore_travel; good_frames; good_ticks
        }
    }
}

impl AxisSettings {
    /// What the blocks of the core do not check, or of which they would not name the degree of freedom.
    pub(crate) fn check(
        &self,
        is_length: bool,
        safety: &core::SafetySettings,
    ) -> Result<(), core::ConfigError> {
        let width = self.width_limit;
        let positive = [
            ("width_limit", width),
            ("speed", self.speed()),
            ("command_speed", self.command_speed()),
            ("expected_width", self.expected_width.unwrap_or(width)),
            ("lever", self.lever),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(error(name, value, "a finite number above 0"));
            }
        }
        // A slack of more than a metre is one in millimetres.
        if is_length && width > 1.0 {
            return Err(error("width_limit", width, "at most 1 m"));
        }
        if is_length && self.speed() > 10.0 {
            return Err(error("speed", self.speed(), "at most 10 m/s"));
        }
        if let Some((low, high)) = self.range
            && !(high > low && high - low <= MOST_RANGE * width)
        {
            let allowed =
                "above range[0], by at most 100 width_limit; in m and rad, not mm and degrees";
            return Err(error("range[1]", high, allowed));
        }
        if let Some(expected) = self.expected_width
            && expected > width
        {
            return Err(error("expected_width", expected, "at most width_limit"));
        }
        core::Play::new(self.delta_minus, self.delta_plus)?;
        if safety.off.contains(core::Flag::WidthLimit) {
            return Ok(());
        }
        let (minus, plus) = (self.delta_minus, self.delta_plus);
        for (name, offset) in [("delta_minus", minus), ("delta_plus", plus)] {
            if offset.abs() > OFFSET_LIMIT * width * ROUNDING {
                return Err(error(name, offset, "at most 2/3 width_limit from 0"));
            }
        }
        if plus - minus > width * ROUNDING {
            let allowed = "at most width_limit above delta_minus";
            return Err(error("delta_plus", plus, allowed));
        }
        Ok(())
    }

    fn speed(&self) -> f64 {
        self.speed.unwrap_or(SPEED * self.width_limit)
    }

    fn command_speed(&self) -> f64 {
        let usual = COMMAND_SPEED * self.gain_limit * self.speed();
        self.command_speed.map_or(usual, |own| own.min(usual))
    }

    fn settings(&self, article: &core::DofSettings, gain: f64) -> core::DofSettings {
        let width = self.width_limit;
        core::DofSettings {
            update_distance: width / UPDATES,
            expected_width: self.expected_width.unwrap_or(EXPECTED_WIDTH * width),
            start_deviation: START_DEVIATION * width,
            free_gain: gain,
            gain_limit: gain,
            delta_minus: self.delta_minus,
            delta_plus: self.delta_plus,
            ..*article
        }
    }
}

const fn error(field: &'static str, value: f64, allowed: &'static str) -> core::ConfigError {
    core::ConfigError {
        field,
        value,
        allowed,
    }
}
