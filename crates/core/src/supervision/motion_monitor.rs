//! Whether hand and tip move as they should: tremor, a tip that outruns its reference, a limit cycle of both.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::error::{ConfigError, require, require_positive};
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::settings::SafetySettings;
use crate::supervision::turning_points::TurningPoints;

/// Over which reversals are counted, in s.
const COUNTED: f64 = 1.0;
/// A swing grows if it is so many times the one before it.
const GROWTH: f64 = 1.1;
/// A tip that travels more than so many times what its reference does has not crossed a slack.
const OUTRUN: f64 = 1.5;
/// Slack unlearnt in a stroke that was not there, in `ahead`; less is what any learning does.
const UNLEARNT: f64 = 2.0;

/// When a motion is wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionMonitorSettings {
    /// Control period, in s.
    pub period: f64,
    /// Least swing of a tremor [m, rad, rad].
    pub tremor_swing: PerDof<f64>,
    /// Largest swing of a tremor [m, rad, rad].
    pub slack: PerDof<f64>,
    /// Reversals in a second that are a tremor.
    pub tremor_rate: f64,
    /// How far a motion comes back before it has turned [m, rad, rad].
    pub turn: PerDof<f64>,
    /// How much farther than the reference the tip may come in a stroke [m, rad, rad].
    pub ahead: PerDof<f64>,
    /// Swings in a row, each larger than the one before, that are a limit cycle.
    pub cycle_swings: u32,
    /// Longest swing of a limit cycle, in s.
    pub cycle_time: f64,
}

/// Watches reference and tip of every DOF.
///
/// ```text
/// tremor             rate <- exp(-period / 1 s) rate + reversals,   rate > tremor_rate
/// overcompensation   d (m - m0) > 1.5 d (u - u0),   d (m - m0) - d (u - u0) > ahead   and   d (m - u) > ahead,
///                    or d (delta0 - delta) > 2 ahead
/// limit cycle        cycle_swings swings of u and as many of m, each 1.1 times the one before it or more
/// ```
///
/// with the reference u, the measured tip m, the contact offset delta that its motion uses, all three when the reference
/// turned last (u0, m0, delta0), and the direction d it has taken since. A slack that is crossed leaves the tip behind; it comes farther than its reference only if less slack
/// was there than was made up for. Of a tip that had been left behind before it is no sign, nor is a bias of the images.
///
/// Wrong about over-compensation where images tell a wrong time, for the tip is then seen too late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionMonitor {
    axes: PerDof<Motion>,
    kept: f64,
    tremor_rate: f64,
    cycle_swings: u32,
    cycle_time: f64,
}

impl MotionMonitor {
    /// Before the first motion.
    ///
    /// # Errors
    /// A value is not a finite number above 0, or `cycle_swings` is 0.
    pub fn new(
        safety: &SafetySettings,
        dofs: &PerDof<DofSettings>,
        period: f64,
    ) -> Result<Self, ConfigError> {
        let settings = MotionMonitorSettings {
            period,
            tremor_swing: dofs.map(|dof| dof.update_distance * safety.tremor_swing),
            slack: safety.width_limit,
            tremor_rate: safety.tremor_rate,
            turn: dofs.map(|dof| dof.update_distance),
            ahead: safety.width_limit.map(|width| safety.ahead_limit * width),
            cycle_swings: safety.cycle_swings,
            cycle_time: safety.cycle_time,
        };
        require_positive("period", settings.period)?;
        for (field, lengths) in [
            ("tremor_swing", settings.tremor_swing),
            ("width_limit", settings.slack),
            ("update_distance", settings.turn),
            ("ahead_limit", settings.ahead),
        ] {
            for length in lengths {
                require_positive(field, length)?;
            }
        }
        require_positive("tremor_rate", settings.tremor_rate)?;
        require_positive("cycle_time", settings.cycle_time)?;
        let swings = settings.cycle_swings;
        require(swings > 0, "cycle_swings", f64::from(swings), "1 or above")?;
        let [t1, t2, t3] = settings.tremor_swing;
        let [s1, s2, s3] = settings.slack;
        let [b1, b2, b3] = settings.turn;
        let [a1, a2, a3] = settings.ahead;
        Ok(Self {
            axes: [
                Motion::new(t1, s1, b1, a1),
                Motion::new(t2, s2, b2, a2),
                Motion::new(t3, s3, b3, a3),
            ],
            kept: libm::exp(-settings.period / COUNTED),
            tremor_rate: settings.tremor_rate,
            cycle_swings: swings,
            cycle_time: settings.cycle_time,
        })
    }

    /// A control tick with what was admitted of the reference.
    pub fn tick(&mut self, reference: PerDof<f64>) -> Flags {
        let mut trembles = false;
        for (axis, reference) in self.axes.iter_mut().zip(reference) {
            axis.reversals *= self.kept;
            if axis
                .hand
                .follow(reference)
                .is_some_and(|swing| swing < axis.slack)
            {
                axis.reversals += 1.0;
            }
            trembles |= axis.reversals > self.tremor_rate;
        }
        Flags::when(trembles, Flag::Tremor)
    }

    /// An image of `time` in s: the reference then, the tip as measured, NaN where it was not, and the slack believed
    /// in.
    pub fn look(
        &mut self,
        time: f64,
        reference: PerDof<f64>,
        measured: PerDof<f64>,
        play: PerDof<Play>,
    ) -> Flags {
        let (mut is_over, mut cycles) = (false, false);
        let signals = reference.into_iter().zip(measured).zip(play);
        for (axis, ((reference, measured), play)) in self.axes.iter_mut().zip(signals) {
            if reference.is_finite() && measured.is_finite() {
                is_over |= axis.look(time, reference, measured, play, self.cycle_time);
                cycles |= axis
                    .growing
                    .iter()
                    .all(|each| each.count >= self.cycle_swings);
            }
        }
        Flags::when(is_over, Flag::Overcompensation).union(Flags::when(cycles, Flag::LimitCycle))
    }
}

/// One DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Motion {
    slack: f64,
    ahead: f64,
    hand: TurningPoints,
    reversals: f64,
    reference: TurningPoints,
    tip: TurningPoints,
    /// Reference and tip where the reference came farthest, and where it turned last.
    farthest: (f64, f64),
    start: Option<(f64, f64)>,
    /// The slack believed in then.
    play: Option<Play>,
    /// Of reference and tip.
    growing: [Growing; 2],
}

impl Motion {
    const fn new(tremor_swing: f64, slack: f64, turn: f64, ahead: f64) -> Self {
        let still = Growing {
            count: 0,
            swing: f64::INFINITY,
            time: f64::NAN,
        };
        Self {
            slack,
            ahead,
            hand: TurningPoints::new(tremor_swing),
            reversals: 0.0,
            reference: TurningPoints::new(turn),
            tip: TurningPoints::new(turn),
            farthest: (f64::NAN, f64::NAN),
            start: None,
            play: None,
            growing: [still; 2],
        }
    }

    /// Whether the tip has outrun its reference, or slack was unlearnt in this stroke.
    fn look(&mut self, time: f64, reference: f64, measured: f64, play: Play, longest: f64) -> bool {
        let [of_reference, of_tip] = &mut self.growing;
        if let Some(swing) = self.reference.follow(reference) {
            of_reference.turned(time, swing, longest);
            self.start = Some(self.farthest);
            self.play = Some(play);
        }
        if let Some(swing) = self.tip.follow(measured) {
            of_tip.turned(time, swing, longest);
        }
        if self.reference.is_farthest(reference) {
            self.farthest = (reference, measured);
        }
        let direction = self.reference.direction();
        let outrun = self.start.is_some_and(|(reference0, measured0)| {
            let (travel, tip) = (reference - reference0, measured - measured0);
            direction * tip > OUTRUN * direction * travel
                && direction * (measured - reference) > self.ahead
                && direction * (tip - travel) > self.ahead
        });
        let unlearnt = self.play.map_or(0.0, |then| {
            if direction > 0.0 {
                then.delta_plus() - play.delta_plus()
            } else {
                play.delta_minus() - then.delta_minus()
            }
        });
        outrun || unlearnt > UNLEARNT * self.ahead
    }
}

/// How many swings in a row have grown.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Growing {
    count: u32,
    swing: f64,
    time: f64,
}

impl Growing {
    fn turned(&mut self, time: f64, swing: f64, longest: f64) {
        let grows = time - self.time <= longest && swing >= GROWTH * self.swing;
        self.count = if grows {
            self.count.saturating_add(1)
        } else {
            0
        };
        (self.swing, self.time) = (swing, time);
    }
}
