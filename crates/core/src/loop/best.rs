//! Profile `best`: the vector law on one linear filter.

use crate::article::estimator::{Trigger, Triggers};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::dof::zip_with;
use crate::error::ConfigError;
use crate::estimation::estimate::{Estimate, GeometryPrior};
use crate::estimation::estimate_settings::EstimateSettings;
use crate::estimation::history::{Entry, History};
use crate::estimation::measurement::Linear;
use crate::law::vector_law::{Bounds, VectorLaw};
use crate::r#loop::measurement::Measurement;
use crate::r#loop::profile::{Profile, Updated};
use crate::r#loop::report::SlackEstimate;
use crate::r#loop::settings::LoopSettings;
use crate::model::features::GEOMETRY;
use crate::model::plays::{COEFFICIENTS, Plays, Row};
use crate::model::slack::Slack;
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::monitors::Law;
use crate::supervision::prediction_monitor::PredictionMonitor;

/// Errors of the geometry of the article's instrument: those of the model, and of each feature.
pub const ERRORS: usize = GEOMETRY + 4;
/// Deflection over the half width from which on a DOF counts as in contact.
const CONTACT: f64 = 0.9;
/// Shift of the image, over its standard deviation before and after the images, from which on the geometry counts as wrong.
const CERTAIN: f64 = 3.0;
/// Standard deviation by which an image without markers makes the tip less certain, and up to which, in `start_deviation`:
/// a tip that rests stays where it is, however long it is not seen.
const MISS: f64 = 0.03;
const MISSED: f64 = 0.5;
/// Plays of the past that are kept for measurements that arrive late, over the history's span.
const PASTS: usize = 8;

/// The plays at a time of the history.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PastPlays<const N: usize> {
    time: f64,
    plays: Plays<N>,
}

/// Profile `best` of N DOFs, whose measurements have M rows and G errors of the geometry, which are estimated as well:
/// D = N `COEFFICIENTS` + G coefficients. By default that of the article's instrument.
#[derive(Debug, Clone, PartialEq)]
pub struct Best<
    const N: usize = 3,
    const M: usize = 4,
    const G: usize = ERRORS,
    const D: usize = { 3 * COEFFICIENTS + ERRORS },
> {
    pub(super) law: VectorLaw<N>,
    /// The plays at the time of the newest measurement, and some before, oldest first.
    newest: PastPlays<N>,
    older: [PastPlays<N>; PASTS],
    /// The plays at the time of the measurement at hand.
    pub(super) measured: Plays<N>,
    pub(super) estimate: Estimate<N, G, D>,
    pub(super) settings: EstimateSettings,
    /// Of the estimate, after the last measurement.
    rows: [Row; N],
    pub(super) slack: [Slack; N],
    pub(super) dofs: [DofSettings; N],
    limits: [PlayLimit; N],
    prediction: PredictionMonitor<N>,
}

impl<const N: usize, const M: usize, const G: usize, const D: usize> Law<N> for Best<N, M, G, D> {
    fn command(&self) -> [f64; N] {
        self.law.command
    }

    fn propose(&mut self, reference: [f64; N]) -> [f64; N] {
        self.law.propose(reference, &self.rows, self.estimate.ratio)
    }

    fn commit(&mut self, command: [f64; N]) {
        self.law.commit(command);
        if self.estimate.origin.iter().any(|origin| origin.is_nan()) {
            self.estimate.origin = self.law.origin;
        }
    }

    fn shift_reference(&mut self, shift: [f64; N]) {
        self.law.shift_reference(shift);
    }

    fn set_share(&mut self, share: f64) {
        self.law.share = share;
    }
}

impl<const N: usize, const M: usize, const G: usize, const D: usize> Profile<N>
    for Best<N, M, G, D>
{
    type Evidence = Linear<N, M, G>;

    const IS_COUPLED: bool = true;

    fn predicted_state(&self) -> [f64; N] {
        self.estimate.tip(&self.law.plays)
    }

    fn play(&self) -> [Play; N] {
        let offsets = zip_with(
            self.slack.map(|own| own.offsets()),
            self.limits,
            |own, limit| {
                let [minus, plus] = own;
                limit.clamp(minus, plus)
            },
        );
        offsets.map(|[minus, plus]| Play::from_ordered(minus, plus))
    }

    fn slack_estimate(&self) -> SlackEstimate<N> {
        let (slack, deviation) = (self.slack, self.estimate.slack_deviation());
        SlackEstimate {
            half_width: slack.map(|own| own.half_width),
            width_std: deviation.map(|own| own.half_width),
            centre: slack.map(|own| own.centre),
            gain: slack.map(|own| own.gain),
            gain_std: deviation.map(|own| own.gain),
        }
    }

    fn keep_up<S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>>(
        &mut self,
        history: &History<S, N>,
        has_clock_gone_back: bool,
    ) {
        let newest = history.newest_time();
        if has_clock_gone_back {
            // The history has forgotten what was before.
            self.newest = PastPlays {
                time: newest,
                plays: self.law.plays,
            };
            self.older = [self.newest; PASTS];
        } else if self.newest.time.is_nan() {
            self.newest.time = f64::NEG_INFINITY;
            self.older = [self.newest; PASTS];
        }
        // The history forgets what the plays of the measurements have not followed.
        let covered = history.covered();
        if newest - self.newest.time > 0.75 * covered
            && let Some(half) = history.at(newest - covered / 2.0)
        {
            self.advance(history, &half);
        }
    }

    fn advance<S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>>(
        &mut self,
        history: &History<S, N>,
        past: &Entry<N>,
    ) {
        self.measured = self.plays_at(history, past);
        if past.time > self.newest.time {
            let [.., last] = &self.older;
            #[expect(clippy::cast_precision_loss, reason = "a small number")]
            if past.time - last.time > history.span() / PASTS as f64 {
                self.older.rotate_left(1);
                let [.., last] = &mut self.older;
                *last = self.newest;
            }
            self.newest = PastPlays {
                time: past.time,
                plays: self.measured,
            };
        }
        self.estimate.advance(self.measured.travel);
    }

    fn update(
        &mut self,
        past: &Entry<N>,
        measurement: &Measurement<N, Self::Evidence>,
        updates_offsets: bool,
    ) -> Updated<N> {
        self.estimate.update(
            &self.measured,
            &measurement.evidence,
            measurement.distance,
            !updates_offsets,
        );
        if !updates_offsets {
            return ([Triggers::default(); N], Flags::NONE);
        }
        self.rows = self.estimate.coefficients();
        self.slack = self.estimate.slack();
        let measured = self.estimate.after_start(measurement.state);
        let (time, predicted) = (past.time, past.predicted_state);
        let has_changed = self.prediction.update(time, predicted, measured);
        let raised = Flags::when(self.law.is_limited, Flag::WidthLimit)
            .union(Flags::when(has_changed, Flag::SlackChanged))
            .union(Flags::when(self.is_geometry_off(), Flag::GeometryOff));
        (self.triggers(past), raised)
    }

    fn miss(&mut self, _: &Entry<N>) {
        let start = self.dofs.map(|dof| dof.start_deviation);
        self.estimate.loosen(
            start.map(|start| MISS * start),
            start.map(|start| MISSED * start),
        );
    }

    fn reset_prediction(&mut self, _: &Entry<N>) {
        let start = self.dofs.map(|dof| dof.start_deviation);
        self.estimate.loosen(start, [f64::INFINITY; N]);
    }
}

impl<const N: usize, const M: usize, const G: usize, const D: usize> Best<N, M, G, D> {
    /// The profile at rest, with the limits of the offsets, errors of the geometry, and limits of the low-passed error of the
    /// predicted tip in units.
    ///
    /// # Errors
    /// A setting is out of range.
    pub(super) fn with_geometry(
        settings: &LoopSettings<N>,
        limits: [PlayLimit; N],
        geometry: [GeometryPrior; G],
        slack_changed: [f64; N],
    ) -> Result<Self, ConfigError> {
        let transmission = settings.transmission()?;
        let dofs = settings.dofs;
        let mut slack = [Slack::default(); N];
        for (slack, dof) in slack.iter_mut().zip(&dofs) {
            let play = Play::new(dof.delta_minus, dof.delta_plus)?;
            slack.half_width = play.width() / 2.0;
            slack.centre = f64::midpoint(play.delta_minus(), play.delta_plus());
        }
        let own = settings.estimation;
        let start_std = dofs.map(|dof| dof.start_deviation);
        let estimate = Estimate::new(own, transmission, geometry, &slack, start_std)?;
        let rest = PastPlays {
            time: f64::NAN,
            plays: Plays::REST,
        };
        let bounds = Bounds {
            width_limit: settings.safety.width_limit,
            speed: settings.safety.command_speed,
            period: settings.control.period,
            input_age: settings.safety.reference_age,
            offsets: limits,
        };
        Ok(Self {
            law: VectorLaw::new(settings.law, transmission, &bounds)?,
            newest: rest,
            older: [rest; PASTS],
            measured: Plays::REST,
            settings: own,
            rows: estimate.coefficients(),
            slack: estimate.slack(),
            estimate,
            dofs,
            limits,
            prediction: PredictionMonitor::new(slack_changed, transmission.unit()),
        })
    }

    /// The plays at a tick of the history.
    pub(super) fn plays_at<S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>>(
        &self,
        history: &History<S, N>,
        to: &Entry<N>,
    ) -> Plays<N> {
        let pasts = self.older.iter().chain(core::iter::once(&self.newest));
        let Some(past) = pasts.rev().find(|past| past.time <= to.time) else {
            return self.newest.plays;
        };
        let ticks = history
            .since(past.time)
            .filter(|entry| entry.time < to.time);
        let mut plays = past.plays;
        if to.time > past.time {
            for entry in ticks.chain(core::iter::once(to)) {
                self.law.follow(&mut plays, entry.command);
            }
        }
        plays
    }

    /// Whether the shift of the image is larger than what is told of the camera leaves open, and than what images do.
    fn is_geometry_off(&self) -> bool {
        let (mean, std) = self.estimate.geometry();
        let ([_, u, v, ..], [_, u_std, v_std, ..]) = (&mean[..], &std[..]) else {
            return false;
        };
        let shift = libm::hypot(*u, *v);
        let told = self.settings.image_deviation;
        shift > CERTAIN * told.max(libm::hypot(*u_std, *v_std))
    }

    /// The contacts in which each DOF was: there an image measures an offset.
    fn triggers(&self, past: &Entry<N>) -> [Triggers; N] {
        let mut triggers = [Triggers::default(); N];
        let dofs = past.command.into_iter().zip(past.predicted_state);
        let dofs = dofs.zip(self.estimate.origin).zip(&self.slack);
        for (triggers, (((command, tip), origin), slack)) in triggers.iter_mut().zip(dofs) {
            let output = origin + (tip - origin) / slack.gain;
            let value = (command - output - slack.centre) / slack.half_width;
            triggers.minus = (value < -CONTACT).then_some(Trigger::Contact);
            triggers.plus = (value > CONTACT).then_some(Trigger::Contact);
        }
        triggers
    }
}
