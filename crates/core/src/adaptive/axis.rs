//! One DOF of profile `best`: lead law, offsets over position, and a play state that images correct.

use crate::adaptive::contact::Stroke;
use crate::adaptive::friction::SlackShare;
use crate::adaptive::offset_map::Side;
use crate::adaptive::parameters::AxisParameters;
use crate::adaptive::slack::Slack;
use crate::adaptive::smoother::Smoother;
use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::error::ConfigError;

/// Standard deviation of an offset that was measured, in `cautious_deviation`.
const KNOWN: f64 = 0.25;

/// Compensates one DOF and learns its offsets; every quantity in the unit of the DOF.
///
/// `step` moves the command, `learn` takes in the image. The lead law runs on the smoothed
/// reference, so tremor passes with a gain near 1; what the command may do in a tick is bounded by
/// `0 <= dc / du <= gain_limit` last of all.
#[derive(Debug, Clone, PartialEq)]
pub struct AdaptiveAxis {
    settings: AxisParameters,
    slack: Slack,
    smoother: Smoother,
    stroke: Stroke,
    reference: Option<f64>,
    /// The smoothed reference up to which the lead has been worked out.
    intended: f64,
    lead: f64,
    command: f64,
    tip: f64,
    upwards: Option<bool>,
    landed: bool,
    cautious: bool,
    share: f64,
}

impl AdaptiveAxis {
    /// A DOF that starts from the offsets of `play`, which it trusts as far as the prior says.
    ///
    /// # Errors
    /// A setting is out of range.
    pub(crate) fn new(settings: AxisParameters, play: Play) -> Result<Self, ConfigError> {
        let settings = settings.checked()?;
        Ok(Self {
            settings,
            slack: Slack::new(settings.prior, settings.change, play),
            smoother: Smoother::new(settings.tremor_time, settings.period),
            stroke: Stroke::new(),
            reference: None,
            intended: f64::NAN,
            lead: 0.0,
            command: f64::NAN,
            tip: f64::NAN,
            upwards: None,
            landed: false,
            cautious: false,
            share: 1.0,
        })
    }

    /// The command c; NaN before the first reference.
    pub const fn command(&self) -> f64 {
        self.command
    }

    /// The predicted state q; NaN before the first reference.
    pub const fn predicted_state(&self) -> f64 {
        self.tip
    }

    /// The offsets where the reference is now.
    pub fn play(&self) -> Play {
        self.slack.play(self.reference.unwrap_or(0.0))
    }

    /// Standard deviation of (`delta_minus`, `delta_plus`) where the reference is now.
    pub fn deviation(&self) -> (f64, f64) {
        let at = self.reference.unwrap_or(0.0);
        let [minus, plus] = Side::BOTH.map(|side| libm::sqrt(self.slack.variance(side, at)));
        (minus, plus)
    }

    /// Least and largest offset where the reference is now, each a standard deviation beyond what was learnt; infinite
    /// while it is hardly known.
    pub(crate) fn offsets(&self) -> (f64, f64) {
        let (play, (minus, plus)) = (self.play(), self.deviation());
        let spare = |deviation: f64| {
            if deviation < KNOWN * self.settings.cautious_deviation {
                deviation
            } else {
                f64::INFINITY
            }
        };
        (
            play.delta_minus() - spare(minus),
            play.delta_plus() + spare(plus),
        )
    }

    /// Travel of the tip over the command's in contact: mean and standard deviation.
    pub fn gain(&self) -> (f64, f64) {
        self.slack.gain()
    }

    /// The command for the next reference.
    ///
    /// The first reference is passed through. A reference that has not changed, or is not finite,
    /// gives the same command again, bit for bit.
    pub fn step(&mut self, reference: f64) -> f64 {
        self.step_within(reference, |command| command)
    }

    /// [`AdaptiveAxis::step`] whose command `limit` may change before the axis goes on from it.
    ///
    /// `limit` is called exactly once, with the command of the law.
    pub(crate) fn step_within(&mut self, reference: f64, limit: impl FnOnce(f64) -> f64) -> f64 {
        let lawful = self.propose(reference);
        let command = limit(lawful.unwrap_or(self.command));
        if lawful.is_some() || (command - self.command).abs() > 0.0 {
            self.command = command;
            let tip = if self.tip.is_nan() { command } else { self.tip };
            self.tip = self.slack.carried(tip, command);
        }
        self.command
    }

    /// The command of the law for the next reference; None where nothing moves.
    fn propose(&mut self, reference: f64) -> Option<f64> {
        if !reference.is_finite() {
            return None;
        }
        let smooth = self.smoother.step(reference);
        let Some(last) = self.reference.replace(reference) else {
            self.slack.centre(reference);
            self.intended = smooth;
            return Some(reference);
        };
        let increment = reference - last;
        if increment == 0.0 {
            return None;
        }
        self.slack.pass(self.settings.period);
        let intention = smooth - self.intended;
        self.intended = smooth;
        if intention != 0.0 {
            self.move_lead(reference, intention);
        }
        // Eq. (2), to the last bit.
        let farthest = self.command + self.settings.gain_limit * increment;
        let command = (reference + self.lead)
            .max(self.command.min(farthest))
            .min(self.command.max(farthest));
        Some(command)
    }

    fn move_lead(&mut self, reference: f64, intention: f64) {
        let settings = &self.settings;
        let upwards = intention > 0.0;
        let (side, sign) = if upwards {
            (Side::Plus, 1.0)
        } else {
            (Side::Minus, -1.0)
        };
        let deviation = libm::sqrt(self.slack.variance(side, reference));
        if self.upwards != Some(upwards) {
            self.upwards = Some(upwards);
            self.landed = false;
            self.cautious = deviation > settings.cautious_deviation;
        }
        let stretch = self.slack.stretch().min(settings.gain_limit);
        let missing = sign * (self.slack.aimed(side, reference) - self.lead);
        let position = self.command - self.tip;
        let gap = sign * (self.slack.aimed(side, self.tip) - position);
        // Up to where the contact may already be.
        let sure = gap - deviation * deviation / settings.cautious_deviation;
        self.landed |= sure <= 0.0;
        let mut law = settings.law;
        law.settling += deviation;
        if self.cautious {
            law.contact_gain = settings.cautious_gain;
        }
        if self.share < 1.0 {
            law.free_gain = 1.0 + self.share * (law.free_gain - 1.0);
            law.contact_gain = law.contact_gain.min(law.free_gain);
        }
        let gap = if self.landed { 0.0 } else { sure };
        self.lead += sign * law.gain(intention.abs(), stretch, gap, missing);
    }

    /// Learn from command and output of one instant, the output's standard deviation, and the
    /// commands since, oldest first.
    pub fn learn(
        &mut self,
        command: f64,
        measured: f64,
        deviation: f64,
        since: impl Iterator<Item = f64>,
    ) -> Triggers {
        let settings = self.settings;
        let model = settings.model_deviation;
        let variance = deviation * deviation + model * model;
        if !(command.is_finite() && measured.is_finite() && variance.is_finite()) {
            return Triggers::default();
        }
        let gains = self.slack.gains();
        let motion = self
            .stroke
            .follow(&settings.contact, gains, command, measured);
        let triggers = motion.map_or_else(Triggers::default, |motion| {
            self.slack.learn(motion, command, measured, variance)
        });
        self.observe(command, measured, variance, since);
        triggers
    }

    /// Carry the measured output to now and move the play state there, by the ratio of variances.
    fn observe(
        &mut self,
        command: f64,
        measured: f64,
        variance: f64,
        since: impl Iterator<Item = f64>,
    ) {
        let mut tip = self.slack.carried(measured, command);
        for command in since {
            tip = self.slack.carried(tip, command);
        }
        let model = self.settings.model_deviation;
        let [minus, plus] = Side::BOTH.map(|side| self.slack.variance(side, measured));
        let own = model * model + minus.min(plus);
        self.tip += self.settings.correction * own / (own + variance) * (tip - self.tip);
        self.tip = self.slack.carried(self.tip, self.command);
    }

    /// Use a share of the gains beyond 1: all of them with 1, no compensation with 0. Bumpless.
    pub(crate) const fn set_share(&mut self, share: f64) {
        self.share = share;
    }

    /// Half the width of the slack learnt where the reference is.
    pub(crate) fn half_width(&self) -> f64 {
        self.slack.half_width(self.reference.unwrap_or(0.0))
    }

    /// How much of its friction is shared, 0 to 1.
    pub(crate) const fn shared(&self) -> f64 {
        self.slack.shared()
    }

    /// So much of the slack is left for this DOF if all friction is shared; the other DOF shares so much of its own.
    pub(crate) fn set_slack_share(&mut self, part: SlackShare, of_other: f64) {
        self.slack.set_slack_share(part, of_other);
        if self.tip.is_finite() {
            self.tip = self.slack.carried(self.tip, self.command);
        }
    }

    /// Believe in no more slack than that.
    pub(crate) const fn limit(&mut self, limit: PlayLimit) {
        self.slack.set_limit(limit);
    }

    pub(crate) const fn play_limit(&self) -> PlayLimit {
        self.slack.limit()
    }

    /// Whether more slack than may be was learnt where the reference is.
    pub(crate) fn is_limited(&self) -> bool {
        self.slack.is_limited(self.reference.unwrap_or(0.0))
    }

    /// Count the reference from elsewhere by `shift`: the command stays.
    pub(crate) fn shift_reference(&mut self, shift: f64) {
        if let Some(reference) = &mut self.reference {
            *reference += shift;
            self.intended += shift;
            self.smoother.shift(shift);
        }
    }
}
