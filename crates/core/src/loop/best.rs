//! Profile `best`: the vector law on one linear filter.

use nalgebra::{SMatrix, SVector};

use crate::article::estimator::{Trigger, Triggers};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::article::state::{StateEstimate, StateEstimator, found};
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::estimate::{Estimate, GeometryPrior};
use crate::estimation::estimate_settings::EstimateSettings;
use crate::estimation::history::{Entry, History};
use crate::estimation::measurement::{Observed, Sensor};
use crate::estimation::posture::{Belief, Observation};
use crate::law::vector_law::{Bounds, VectorLaw};
use crate::r#loop::measurement::{ERRORS, Measurement};
use crate::r#loop::paper::state_estimator;
use crate::r#loop::profile::{Image, ImageUpdate, ProfileBlocks};
use crate::r#loop::reduction::HysteresisReduction;
use crate::r#loop::report::HysteresisEstimate;
use crate::r#loop::settings::Settings;
use crate::model::features::{FeatureModel, FeaturePrediction};
use crate::model::plays::{COEFFICIENTS, Plays, Row};
use crate::model::slack::Slack;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::monitors::Law;
use crate::supervision::prediction_monitor::PredictionMonitor;

/// Limits of the low-passed error of the predicted tip, in units.
const SLACK_CHANGED: PerDof<f64> = [0.13, 0.3, 0.13];
/// Deflection over the half width from which on a DOF counts as in contact.
const CONTACT: f64 = 0.9;
/// Angle in rad by which the image seems shifted from which on the geometry counts as wrong, and the shift over its standard
/// deviation.
const GEOMETRY_OFF: f64 = 0.02;
const CERTAIN: f64 = 3.0;
/// Standard deviation in px of the bands in an apparent state.
const APPARENT: f64 = 0.1;
/// Standard deviation by which an image without markers makes the tip less certain, in `start_deviation`.
const MISS: f64 = 0.03;
/// The estimate of an instrument with two bands.
type InstrumentEstimate = Estimate<3, ERRORS, { 3 * COEFFICIENTS + ERRORS }>;

/// The plays at a time of the history.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PastPlays {
    time: f64,
    plays: Plays<3>,
}

/// Profile `best`.
#[derive(Debug, Clone, PartialEq)]
pub struct Best {
    law: VectorLaw<3>,
    /// The plays at the time of the last image.
    past: PastPlays,
    estimate: InstrumentEstimate,
    settings: EstimateSettings,
    /// Of the estimate, after the last image.
    rows: [Row; 3],
    slack: [Slack; 3],
    start_std: PerDof<f64>,
    limits: PerDof<PlayLimit>,
    observability: StateEstimator,
    prediction: PredictionMonitor<3>,
    /// Shorter focal length in px.
    focal: f64,
}

impl Law<3> for Best {
    fn command(&self) -> PerDof<f64> {
        self.law.command()
    }

    fn propose(&mut self, reference: PerDof<f64>) -> PerDof<f64> {
        self.law
            .propose(reference, &self.rows, self.estimate.ratio())
    }

    fn commit(&mut self, command: PerDof<f64>) {
        self.law.commit(command);
        if self.estimate.origin().iter().any(|origin| origin.is_nan()) {
            self.estimate.start(self.law.origin());
        }
    }

    fn shift_reference(&mut self, shift: PerDof<f64>) {
        self.law.shift_reference(shift);
    }

    fn set_share(&mut self, share: f64) {
        self.law.set_share(share);
    }
}

/// Features (4,) of the bands with errors of the geometry: unevenness of the section, shift of the image (2,) in px, and what
/// else the feature model errs (4,) in px.
impl Sensor<3, 4, ERRORS> for FeatureModel {
    const POINT: usize = 2;

    fn features(
        &self,
        state: &[f64; 3],
        [unevenness, u, v, rest @ ..]: &[f64; ERRORS],
    ) -> Option<([f64; 4], [[f64; 4]; 3])> {
        let mut predicted = self.with_geometry([*unevenness, *u, *v]).predict(*state)?;
        for (feature, rest) in predicted.features.iter_mut().zip(rest) {
            *feature += rest;
        }
        Some((predicted.features, predicted.columns))
    }

    fn by_geometry(
        &self,
        state: &[f64; 3],
        [unevenness, u, v, ..]: &[f64; ERRORS],
    ) -> Option<[[f64; 4]; ERRORS]> {
        let model = self.with_geometry([*unevenness, *u, *v]);
        let [by_unevenness, by_u, by_v] = FeatureModel::by_geometry(&model, *state)?;
        let one = |feature| core::array::from_fn(|index| if index == feature { 1.0 } else { 0.0 });
        Some([by_unevenness, by_u, by_v, one(0), one(1), one(2), one(3)])
    }
}

impl ProfileBlocks for Best {
    const IS_COUPLED: bool = true;

    fn new(settings: &Settings, limits: PerDof<PlayLimit>) -> Result<Self, ConfigError> {
        let transmission = settings.transmission()?;
        let dofs = settings.dofs();
        let mut slack = [Slack::default(); 3];
        for (slack, dof) in slack.iter_mut().zip(&dofs) {
            let play = Play::new(dof.delta_minus, dof.delta_plus)?;
            slack.half_width = play.width() / 2.0;
            slack.centre = f64::midpoint(play.delta_minus(), play.delta_plus());
        }
        let own = settings.estimation;
        let start_std = dofs.map(|dof| dof.start_deviation);
        let lasting = |std| GeometryPrior {
            std,
            travel: own.weight_travel,
        };
        let rest = GeometryPrior {
            std: own.misfit_deviation,
            travel: own.misfit_travel,
        };
        let shift = lasting(own.image_deviation);
        let geometry = [
            lasting(own.shape_deviation),
            shift,
            shift,
            rest,
            rest,
            rest,
            rest,
        ];
        let estimate = InstrumentEstimate::new(own, transmission, geometry, &slack, start_std)?;
        Ok(Self {
            law: VectorLaw::new(
                settings.law,
                transmission,
                &Bounds {
                    gain: settings.dofs().map(|dof| dof.free_gain.min(dof.gain_limit)),
                    width_limit: settings.safety.width_limit,
                    step: settings
                        .safety
                        .command_speed
                        .map(|speed| speed * settings.control.period),
                    offsets: limits,
                },
            )?,
            past: PastPlays {
                time: f64::NAN,
                plays: Plays::REST,
            },
            settings: own,
            rows: estimate.coefficients(),
            slack: estimate.slack(),
            estimate,
            start_std,
            limits,
            observability: state_estimator(settings)?,
            prediction: PredictionMonitor::new(SLACK_CHANGED, transmission.unit()),
            focal: settings.camera.fx.min(settings.camera.fy),
        })
    }

    fn predicted_state(&self) -> PerDof<f64> {
        self.estimate.tip(self.law.plays())
    }

    fn play(&self) -> PerDof<Play> {
        let mut plays = self.slack.map(|slack| {
            let [minus, plus] = slack.offsets();
            Play::from_ordered(minus, plus)
        });
        for (play, limit) in plays.iter_mut().zip(self.limits) {
            let [minus, plus] = limit.clamp(play.delta_minus(), play.delta_plus());
            *play = Play::from_ordered(minus, plus);
        }
        plays
    }

    fn keep_up<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &mut self,
        history: &History<S>,
        has_clock_gone_back: bool,
    ) {
        if has_clock_gone_back || self.past.time.is_nan() {
            self.past.time = f64::NEG_INFINITY;
        }
        // The history forgets what the plays of the images have not followed.
        let newest = history.newest_time();
        if newest - self.past.time > 0.75 * history.span()
            && let Some(half) = history.at(newest - history.span() / 2.0)
        {
            self.advance(history, &half);
        }
    }

    fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
        past: &Entry,
    ) -> Belief {
        let plays = self.plays_at(history, past);
        let mut ahead = self.estimate.clone();
        ahead.advance(plays.travel);
        let prior = ahead.prior(&plays);
        Belief {
            state: prior.state.into(),
            deviation: prior.covariance.diagonal().map(libm::sqrt).into(),
        }
    }

    fn advance<S: AsRef<[Entry]> + AsMut<[Entry]>>(&mut self, history: &History<S>, past: &Entry) {
        if past.time > self.past.time {
            self.past = PastPlays {
                time: past.time,
                plays: self.plays_at(history, past),
            };
        }
        self.estimate.advance(self.past.plays.travel);
    }

    fn measure(&self, model: &FeatureModel, _: &Entry, image: Image<'_>) -> Option<Measurement> {
        let prior = self.estimate.prior(&self.past.plays);
        let observed = self.observed(image);
        let outlier = self.settings.outlier_distance;
        let markers = observed.most_probable(model, &prior, &mirrored(), outlier)?;
        let (expected, _) = Sensor::features(model, &prior.state.into(), &prior.geometry.into())?;
        let linear = observed.linearize(model, &prior, markers.used, &self.estimate.noise())?;
        let prediction = FeaturePrediction {
            features: markers.predicted,
            columns: markers.by_state,
        };
        let mut kept = image.features;
        for (value, used) in kept.iter_mut().zip(markers.used) {
            *value = if used { *value } else { f64::NAN };
        }
        let mut innovation = image.features;
        for (value, predicted) in innovation.iter_mut().zip(expected) {
            *value -= predicted;
        }
        let about = self
            .observability
            .estimate(markers.state, &prediction, kept);
        let [a, _, b, _] = markers.used;
        Some(Measurement {
            estimate: StateEstimate {
                state: markers.state,
                innovation,
                ..about
            },
            used: [a, b],
            predicted_features: expected,
            state_deviation: markers.std,
            distance: libm::sqrt(markers.distance_squared),
            bands: Some(linear),
        })
    }

    fn update(
        &mut self,
        past: &Entry,
        measurement: &Measurement,
        updates_offsets: bool,
    ) -> ImageUpdate {
        let Some(linear) = &measurement.bands else {
            return ImageUpdate::default();
        };
        self.estimate.update(
            &self.past.plays,
            linear,
            measurement.distance,
            !updates_offsets,
        );
        self.rows = self.estimate.coefficients();
        if !updates_offsets {
            return ImageUpdate::default();
        }
        self.slack = self.estimate.slack();
        let measured = measurement.estimate.state;
        let has_changed = self
            .prediction
            .update(past.time, past.predicted_state, measured);
        let is_limited = self.slack.iter().zip(self.limits).any(|(slack, limit)| {
            let [minus, plus] = slack.offsets();
            limit.exceeds(minus, plus)
        });
        ImageUpdate {
            triggers: self.triggers(past),
            raised: Flags::when(is_limited, Flag::WidthLimit)
                .union(Flags::when(has_changed, Flag::SlackChanged))
                .union(Flags::when(self.is_geometry_off(), Flag::GeometryOff)),
        }
    }

    fn feature_model(&self, configured: &FeatureModel) -> FeatureModel {
        let ([unevenness, u, v, ..], _) = self.estimate.geometry();
        configured.with_geometry([unevenness, u, v])
    }

    fn apparent(&self, configured: &FeatureModel, belief: Belief) -> Belief {
        let anywhere = Belief {
            deviation: self.start_std,
            ..belief
        };
        let corrected = self.feature_model(configured);
        let nearest = corrected.predict(belief.state).and_then(|expected| {
            let observed = Observation::new(expected.features, [APPARENT; 4]);
            configured.nearest_state(&anywhere, &observed)
        });
        nearest.map_or(belief, |(state, _)| Belief { state, ..belief })
    }

    fn miss(&mut self, _: &Entry) {
        self.estimate.loosen(self.start_std.map(|std| MISS * std));
    }

    fn reset_prediction(&mut self, _: &Entry) {
        self.estimate.loosen(self.start_std);
    }
}

impl<S: AsRef<[Entry]> + AsMut<[Entry]>> HysteresisReduction<Best, S> {
    /// The estimated hysteresis.
    pub fn hysteresis(&self) -> HysteresisEstimate {
        let slack = &self.profile.slack;
        let deviation = self.profile.estimate.slack_deviation();
        let ([unevenness, u, v, ..], [_, u_std, v_std, ..]) = self.profile.estimate.geometry();
        HysteresisEstimate {
            half_width: slack.map(|slack| slack.half_width),
            width_std: deviation.map(|own| own.half_width),
            centre: slack.map(|slack| slack.centre),
            shared: self.profile.estimate.shared(),
            gain: slack.map(|slack| slack.gain),
            gain_std: deviation.map(|own| own.gain),
            unevenness,
            image_shift: [u, v],
            image_shift_std: [u_std, v_std],
        }
    }
}

/// A standard deviation of rotation or bending to either side, in the coordinates of the factor of a covariance: postures that
/// look alike are apart by these.
fn mirrored() -> [SVector<f64, 3>; 4] {
    let start = |rotation, bending| SVector::from([0.0, rotation, bending]);
    [
        start(1.0, 0.0),
        start(-1.0, 0.0),
        start(0.0, 1.0),
        start(0.0, -1.0),
    ]
}

impl Best {
    fn observed(&self, image: Image<'_>) -> Observed<4> {
        let marker = self.settings.marker_deviation;
        let own = SMatrix::<f64, 4, 4>::from_diagonal_element(marker * marker);
        let covariance = image
            .covariance
            .map_or(own, |rows| SMatrix::<f64, 4, 4>::from(*rows));
        let [a, b] = found(image.features);
        Observed {
            features: SVector::from(image.features),
            covariance,
            seen: [a, a, b, b],
        }
    }

    /// The plays at a tick of the history that is not before the last image.
    fn plays_at<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
        to: &Entry,
    ) -> Plays<3> {
        let ticks = history
            .since(self.past.time)
            .filter(|entry| entry.time < to.time);
        let mut plays = self.past.plays;
        if to.time > self.past.time {
            for entry in ticks.chain(core::iter::once(to)) {
                plays = self.law.follow(&plays, entry.command);
            }
        }
        plays
    }

    /// Whether the shift of the image is larger than [`GEOMETRY_OFF`], and than what images leave uncertain.
    fn is_geometry_off(&self) -> bool {
        let ([_, u, v, ..], [_, u_std, v_std, ..]) = self.estimate.geometry();
        let shift = libm::hypot(u, v);
        shift > GEOMETRY_OFF * self.focal && shift > CERTAIN * libm::hypot(u_std, v_std)
    }

    /// The contacts in which each DOF was: there an image measures an offset.
    fn triggers(&self, past: &Entry) -> PerDof<Triggers> {
        let mut triggers = [Triggers::default(); 3];
        let dofs = past
            .command
            .into_iter()
            .zip(past.predicted_state)
            .zip(self.estimate.origin());
        for ((triggers, slack), ((command, tip), origin)) in
            triggers.iter_mut().zip(&self.slack).zip(dofs)
        {
            let output = origin + (tip - origin) / slack.gain;
            let value = (command - output - slack.centre) / slack.half_width;
            triggers.minus = (value < -CONTACT).then_some(Trigger::Contact);
            triggers.plus = (value > CONTACT).then_some(Trigger::Contact);
        }
        triggers
    }
}
