//! Profile `best`: the vector law on one ensemble filter.

use crate::adaptive::vector_law::VectorLaw;
use crate::article::estimator::{Trigger, Triggers};
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::article::state::{StateEstimate, StateEstimator};
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::filter::Filter;
use crate::estimation::history::{Entry, History};
use crate::estimation::posture::{Belief, Observation};
use crate::r#loop::measurement::Measurement;
use crate::r#loop::paper::state_estimator;
use crate::r#loop::profile::{Image, ImageUpdate, ProfileBlocks};
use crate::r#loop::reduction::HysteresisReduction;
use crate::r#loop::report::HysteresisEstimate;
use crate::r#loop::settings::Settings;
use crate::model::features::FeatureModel;
use crate::model::hysteresis::Hysteresis;
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::monitors::Law;
use crate::supervision::prediction_monitor::PredictionMonitor;

/// Deflection over the half width from which on a DOF counts as in contact.
const CONTACT: f64 = 0.98;

/// Angle in rad by which the image seems shifted from which on the geometry counts as wrong, and the shift over its standard
/// deviation.
const GEOMETRY_OFF: f64 = 0.02;
const CERTAIN: f64 = 3.0;

/// Limits of the low-passed error of the predicted tip, in half of `width_limit`.
pub const SLACK_CHANGED: PerDof<f64> = [0.13, 0.3, 0.13];

/// Standard deviation in px of the bands in an apparent state.
const APPARENT: f64 = 0.1;

/// Profile `best`.
#[derive(Debug, Clone, PartialEq)]
pub struct Best {
    law: VectorLaw,
    filter: Filter,
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
        self.law.propose(reference, &self.filter)
    }

    fn commit(&mut self, command: PerDof<f64>) {
        self.law.commit(command, &mut self.filter);
    }

    fn shift_reference(&mut self, shift: PerDof<f64>) {
        self.law.shift_reference(shift);
    }

    fn set_share(&mut self, share: f64) {
        self.law.set_share(share);
    }
}

impl ProfileBlocks for Best {
    const IS_COUPLED: bool = true;

    fn new(settings: &Settings, limits: PerDof<PlayLimit>) -> Result<Self, ConfigError> {
        let unit = settings.safety.width_limit.map(|width| width / 2.0);
        let radius = settings.instrument.diameter / 2.0;
        let dofs = settings.dofs();
        let [first, second, third] = &dofs;
        let play = |dof: &DofSettings| Play::new(dof.delta_minus, dof.delta_plus);
        Ok(Self {
            law: VectorLaw::new(
                &settings.adaptive,
                &dofs,
                &settings.control,
                settings.safety.width_limit,
                settings.safety.command_speed,
                radius,
                limits,
            )?,
            filter: Filter::new(
                settings.state_estimation,
                unit,
                dofs.map(|dof| dof.start_deviation),
                [play(first)?, play(second)?, play(third)?],
                radius,
            )?,
            limits,
            observability: state_estimator(settings)?,
            prediction: PredictionMonitor::new(SLACK_CHANGED, unit),
            focal: settings.camera.fx.min(settings.camera.fy),
        })
    }

    fn predicted_state(&self) -> PerDof<f64> {
        let nominal = self.filter.nominal();
        nominal.lagging_tip(nominal.position.output, nominal.lag)
    }

    fn corrected(&self) -> PerDof<f64> {
        [0.0; 3]
    }

    fn play(&self) -> PerDof<Play> {
        self.filter.plays()
    }

    fn keep_up<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &mut self,
        history: &History<S>,
        has_clock_gone_back: bool,
    ) {
        if has_clock_gone_back {
            self.filter.restart_clock();
        }
        // The history forgets what the filter has not followed.
        let newest = history.newest_time();
        let behind = newest - self.filter.time();
        let past = if behind == f64::INFINITY {
            history.at(newest)
        } else if behind > 0.75 * history.span() {
            let half = newest - history.span() / 2.0;
            self.filter.next_step(history).or_else(|| history.at(half))
        } else {
            None
        };
        if let Some(past) = past {
            self.filter.advance(history, &past);
        }
    }

    fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
        past: &Entry,
    ) -> Belief {
        self.filter.predict(history, past)
    }

    fn advance<S: AsRef<[Entry]> + AsMut<[Entry]>>(&mut self, history: &History<S>, past: &Entry) {
        self.filter.advance(history, past);
    }

    fn measure(&self, model: &FeatureModel, _: &Entry, image: Image<'_>) -> Option<Measurement> {
        let model = &self.feature_model(model);
        let markers = self.filter.markers(image.features, image.covariance);
        let estimate = self.filter.measure(model, &markers)?;
        let prior = self.filter.belief();
        let start = model.predict(prior.state)?;
        let kept = estimate.keep(image.features);
        let about = self
            .observability
            .estimate(estimate.state, &estimate.prediction, kept);
        let mut innovation = image.features;
        for (value, predicted) in innovation.iter_mut().zip(start.features) {
            *value -= predicted;
        }
        Some(Measurement {
            estimate: StateEstimate {
                state: estimate.state,
                innovation,
                ..about
            },
            used: estimate.used,
            predicted_features: start.features,
            state_deviation: estimate.std,
            distance: libm::sqrt(estimate.distance_squared),
            markers: Some(estimate),
            bands: None,
        })
    }

    fn update<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &mut self,
        history: &History<S>,
        past: &Entry,
        measurement: &Measurement,
        image: Image<'_>,
        updates_offsets: bool,
    ) -> ImageUpdate {
        let Some(estimate) = &measurement.markers else {
            return ImageUpdate::default();
        };
        let markers = self.filter.markers(image.features, image.covariance);
        let before = self.parameters();
        self.filter
            .update(history, &markers, estimate, !updates_offsets);
        if !updates_offsets {
            return ImageUpdate::default();
        }
        let after = self.parameters();
        self.law.rate_limit_mut().update(before, after);
        let measured = measurement.estimate.state;
        let has_changed = self
            .prediction
            .update(past.time, past.predicted_state, measured);
        let is_limited = self
            .play()
            .iter()
            .zip(self.limits)
            .any(|(play, limit)| limit.exceeds(play.delta_minus(), play.delta_plus()));
        ImageUpdate {
            triggers: self.triggers(),
            raised: Flags::when(is_limited, Flag::WidthLimit)
                .union(Flags::when(has_changed, Flag::SlackChanged))
                .union(Flags::when(self.is_geometry_off(), Flag::GeometryOff)),
        }
    }

    fn feature_model(&self, configured: &FeatureModel) -> FeatureModel {
        let (geometry, _) = self.filter.geometry();
        configured.with_geometry(geometry)
    }

    fn apparent(&self, configured: &FeatureModel, belief: Belief) -> Belief {
        let anywhere = Belief {
            deviation: self.filter.start_std(),
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
        self.filter.miss();
    }

    fn reset_prediction(&mut self, _: &Entry) {
        self.filter.reset_position();
    }
}

impl<S: AsRef<[Entry]> + AsMut<[Entry]>> HysteresisReduction<Best, S> {
    /// The estimated hysteresis.
    pub fn hysteresis(&self) -> HysteresisEstimate {
        let nominal = self.profile.filter.nominal();
        let ([unevenness, u, v], [_, [_, u_variance, _], [_, _, v_variance]]) =
            self.profile.filter.geometry();
        let Hysteresis {
            half_width,
            centre,
            shared,
        } = nominal.hysteresis;
        HysteresisEstimate {
            half_width,
            width_std: nominal.width_std,
            centre,
            shared,
            gain: nominal.gain,
            lag: nominal.lag,
            unevenness,
            image_shift: [u, v],
            image_shift_std: [u_variance, v_variance].map(libm::sqrt),
        }
    }
}

impl Best {
    /// Whether the shift of the image is larger than [`GEOMETRY_OFF`], and than what images leave uncertain.
    fn is_geometry_off(&self) -> bool {
        let ([_, u, v], [_, [_, u_variance, _], [_, _, v_variance]]) = self.filter.geometry();
        let shift = libm::hypot(u, v);
        shift > GEOMETRY_OFF * self.focal && shift > CERTAIN * libm::sqrt(u_variance + v_variance)
    }

    /// Half widths and centres where the tip is.
    fn parameters(&self) -> [PerDof<f64>; 2] {
        let hysteresis = &self.filter.nominal().hysteresis;
        [hysteresis.half_width, hysteresis.centre]
    }

    /// The contacts in which each DOF is: there an image measures an offset.
    fn triggers(&self) -> PerDof<Triggers> {
        let nominal = self.filter.nominal();
        let mut deflection = self.law.command();
        let at = nominal
            .position
            .output
            .into_iter()
            .zip(nominal.hysteresis.centre);
        for ((value, (output, centre)), half) in deflection
            .iter_mut()
            .zip(at)
            .zip(nominal.hysteresis.half_width)
        {
            *value = (*value - output - centre) / half;
        }
        deflection.map(|value| Triggers {
            minus: (value < -CONTACT).then_some(Trigger::Contact),
            plus: (value > CONTACT).then_some(Trigger::Contact),
        })
    }
}
