//! The update of the loop by a measurement: checks of the monitors, state estimate, offset estimates.

use crate::article::estimator::Triggers;
use crate::article::state::StateEstimate;
use crate::dof::zip_with;
use crate::estimation::expectation::StatePrior;
use crate::estimation::history::Entry;
use crate::r#loop::any_loop::BandLoop;
use crate::r#loop::measurement::{Measurement, is_reversed, is_usable};
use crate::r#loop::observation::Observation;
use crate::r#loop::profile::{BandProfile, BandsView, Image, Profile, Seen};
use crate::r#loop::reduction::{Determined, HysteresisReduction};
use crate::r#loop::report::{GeometryEstimate, Report, Status};
use crate::model::features::FeatureModel;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::frame_gate::{FrameArrival, ImageIdentity};
use crate::supervision::reactions::Reaction;

/// Result of an update by a measurement, of which the sensor has the view `V`.
pub(super) struct Outcome<const N: usize, V> {
    pub(super) status: Status,
    /// The loop at the time of capture.
    pub(super) past: Option<Entry<N>>,
    /// What was used.
    pub(super) seen: Option<V>,
    pub(super) triggers: [Triggers; N],
}

impl<P: Profile<N>, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>, V, const N: usize>
    HysteresisReduction<P, S, V, N>
{
    /// Update by what one of the sensors saw at `captured_at` in s.
    pub(super) fn update_by<I: Observation<P, N>>(
        &mut self,
        observation: &I,
        captured_at: f64,
        sensor: usize,
        image: Option<ImageIdentity>,
        is_stuck: bool,
    ) -> Outcome<N, I::View> {
        let past = self.history.at(captured_at);
        let arrival = FrameArrival {
            captured_at,
            now: self.history.newest_time(),
            image,
            is_stuck,
            travel: past.map(|past| past.travel),
        };
        let mut raised = self.monitors.check_arrival(&arrival, sensor);
        let outcome = self.examine(observation, captured_at, sensor, past, &mut raised);
        let rate = self.monitors.check_rate(captured_at, sensor);
        let raised = self.monitors.excuse(raised, sensor);
        let fit = self.monitors.check_fit(sensor);
        let raised = raised.union(rate).union(fit);
        self.monitors.react_to_measurement(raised, sensor);
        outcome
    }

    fn examine<I: Observation<P, N>>(
        &mut self,
        observation: &I,
        captured_at: f64,
        sensor: usize,
        past: Option<Entry<N>>,
        raised: &mut Flags,
    ) -> Outcome<N, I::View> {
        let unused = |status, past| Outcome {
            status,
            past,
            seen: None,
            triggers: [Triggers::default(); N],
        };
        let is_repeated = self
            .last_used
            .get(sensor)
            .is_some_and(|last| captured_at <= *last);
        if is_repeated {
            *raised = self
                .monitors
                .enabled(raised.union(Flags::of(Flag::Duplicate)));
            return unused(Status::Duplicate, None);
        }
        let Some(past) = past else {
            return unused(Status::Stale, None);
        };
        if !raised.is_empty() {
            return unused(Status::Refused, Some(past));
        }
        self.profile.advance(&self.history, &past);
        if !observation.is_usable() {
            self.profile.miss(&past);
            *raised = self.monitors.enabled(Flags::of(Flag::Lost));
            return unused(Status::NoMarkers, Some(past));
        }
        let Some((measurement, view)) = observation.measure(&self.profile, &past) else {
            // The model predicts no features at the predicted state.
            let is_missing = self.is_missing(past.travel, [false; N], sensor);
            let missed = if I::IS_WHOLE {
                Flags::of(Flag::Lost)
            } else {
                Flags::when(is_missing, Flag::Unobservable)
            };
            *raised = self.monitors.enabled(missed);
            return unused(Status::Held, Some(past));
        };
        *raised = self.check_innovation(observation, &past, measurement.distance, &view);
        if !raised.is_empty() {
            // Bands that contradict the prediction for as long as a hold lasts are more credible than the prediction.
            if self.monitors.supervision().reaction == Reaction::Fade {
                self.profile.reset_prediction(&past);
            } else {
                self.profile.miss(&past);
            }
            return unused(Status::Refused, Some(past));
        }
        if let Some(last) = self.last_used.get_mut(sensor) {
            *last = captured_at;
        }
        // With an outlier nothing but the offset is learnt; of bands `merged` says so.
        let is_learnt = I::IS_WHOLE || !measurement.has_outlier;
        let determined = measurement.observable.map(|own| own && is_learnt);
        self.monitors.determine(determined, sensor);
        let is_missing = self.is_missing(past.travel, determined, sensor);
        // Values of a sensor that were not measured leave a DOF open, as another sensor would.
        let is_part = I::IS_WHOLE || measurement.has_outlier;
        let part = if is_part {
            Flag::Merged
        } else {
            Flag::Unobservable
        };
        let missed = [
            Flags::when(is_missing || I::IS_WHOLE, part),
            Flags::when(is_missing, Flag::Unobservable),
        ];
        let (status, triggers) = self.accept(&past, &measurement, missed, raised);
        Outcome {
            status,
            past: Some(past),
            seen: Some(view),
            triggers,
        }
    }

    /// Flags for which the measurement is refused.
    fn check_innovation<I: Observation<P, N>>(
        &self,
        observation: &I,
        past: &Entry<N>,
        distance: f64,
        view: &I::View,
    ) -> Flags {
        let flags = self.monitors.check_innovation(distance);
        let is_exchanged = observation.is_exchanged(view);
        if !is_exchanged && flags.is_empty() {
            return Flags::NONE;
        }
        let fits = |distance| self.monitors.check_innovation(distance).is_empty();
        let is_swapped = is_exchanged || observation.fits_exchanged(&self.profile, past, fits);
        let swapped = self
            .monitors
            .enabled(Flags::when(is_swapped, Flag::Swapped));
        if swapped.is_empty() {
            self.monitors.enabled(flags)
        } else {
            swapped
        }
    }

    /// Whether no measurement has determined a DOF while it may have moved far (N,) [m or rad].
    ///
    /// Of a DOF that another sensor measures counts its motion since that measurement arrived: one that is later than this
    /// sensor's cannot tell of the motion meanwhile.
    fn is_missing(&mut self, travel: [f64; N], observable: [bool; N], sensor: usize) -> bool {
        let travels = travel.into_iter().zip(self.travel);
        for ((last, (at, arrived)), is_observable) in
            self.determined.iter_mut().zip(travels).zip(observable)
        {
            if is_observable || last.at.is_nan() {
                *last = Determined {
                    at,
                    arrived,
                    sensor,
                };
            }
        }
        let unseen = zip_with(travel, self.determined, |travel, last| {
            let is_own = last.sensor == sensor;
            travel - if is_own { last.at } else { last.arrived }
        });
        self.monitors.is_far(unseen)
    }

    /// Updates the estimates from a measurement that has passed the checks.
    ///
    /// `missed` is what a part that is missing, and a DOF that it did not determine, are worth: nothing where another sensor has
    /// them.
    fn accept(
        &mut self,
        past: &Entry<N>,
        measurement: &Measurement<N, P::Evidence>,
        [part, dof]: [Flags; 2],
        raised: &mut Flags,
    ) -> (Status, [Triggers; N]) {
        let status = if measurement.is_partial {
            Status::Partial
        } else if measurement.observable == [true; N] {
            Status::Ok
        } else {
            Status::Held
        };
        // Of two markers with an outlier, the other one may be wrong, too.
        let outlier = self
            .monitors
            .enabled(Flags::when(measurement.has_outlier, Flag::Innovation));
        let is_trusted = outlier.is_empty();
        let updates_offsets =
            is_trusted && self.monitors.supervision().reaction < Reaction::HoldEstimate;
        let mut motion = Flags::NONE;
        // Also while the offsets are held: a fade must not end the search for its cause.
        if is_trusted {
            let play = self.play();
            motion = self.monitors.check_motion(
                past.time,
                past.reference,
                zip_with(measurement.state, measurement.observable, |value, known| {
                    if known { value } else { f64::NAN }
                }),
                play,
            );
        }
        let (triggers, conspicuous) = self.profile.update(past, measurement, updates_offsets);
        let missed = match status {
            Status::Held => dof,
            Status::Ok if !measurement.has_outlier => Flags::NONE,
            _ => part,
        };
        *raised = motion.union(self.monitors.enabled(conspicuous.union(missed)));
        (status, triggers)
    }
}

impl<P: BandProfile, S: AsRef<[Entry]> + AsMut<[Entry]>> BandLoop for HysteresisReduction<P, S> {
    fn on_features(
        &mut self,
        measured: Option<[f64; 4]>,
        covariance: Option<&[[f64; 4]; 4]>,
        captured_at: f64,
        checksum: Option<u64>,
    ) -> Report {
        let identity = checksum.map_or_else(
            || measured.map(|features| ImageIdentity::Features(features.map(f64::to_bits))),
            |sum| Some(ImageIdentity::Checksum(sum)),
        );
        let bands = Bands {
            model: self.view,
            image: measured.map(|features| Image {
                features,
                covariance,
            }),
        };
        let Outcome {
            status,
            past,
            seen,
            triggers,
        } = self.update_by(&bands, captured_at, 0, identity, false);
        let predicted_state = past.map_or([f64::NAN; 3], |past| past.predicted_state);
        let seen = seen.unwrap_or_else(|| self.unseen(predicted_state));
        Report {
            status,
            predicted_state,
            predicted_features: seen.predicted_features,
            triggers,
            estimate: seen.estimate,
            state_deviation: seen.state_deviation,
            play: self.play(),
            supervision: self.monitors.supervision(),
        }
    }

    fn predict_state(&self, captured_at: f64) -> Option<StatePrior> {
        let past = self.history.at(captured_at)?;
        Some(self.profile.predict(&self.history, &past))
    }

    fn predicted_features(&self, captured_at: f64) -> Option<[f64; 4]> {
        let past = self.history.at(captured_at)?;
        let model = self.profile.feature_model(&self.view);
        let prediction = model.predict(past.predicted_state)?;
        Some(prediction.features)
    }

    fn geometry(&self) -> Option<GeometryEstimate> {
        self.profile.geometry()
    }
}

impl<P: BandProfile, S> HysteresisReduction<P, S> {
    /// The view of a frame that updated nothing.
    fn unseen(&self, predicted_state: [f64; 3]) -> BandsView {
        let model = self.profile.feature_model(&self.view);
        let prediction = model.predict(predicted_state);
        BandsView {
            estimate: StateEstimate {
                state: predicted_state,
                observable: [false; 3],
                deviation: [f64::NAN; 3],
                innovation: [f64::NAN; 4],
                inverse: [[0.0; 4]; 3],
            },
            used: [false; 2],
            predicted_features: prediction.map_or([f64::NAN; 4], |prediction| prediction.features),
            state_deviation: [f64::NAN; 3],
        }
    }
}

/// The bands of an image, with the configured feature model.
struct Bands<'a> {
    model: FeatureModel,
    image: Option<Image<'a>>,
}

impl<P: BandProfile> Observation<P, 3> for Bands<'_> {
    type View = BandsView;

    fn is_usable(&self) -> bool {
        self.image.is_some_and(|image| is_usable(image.features))
    }

    fn measure(&self, profile: &P, past: &Entry) -> Option<Seen<P::Evidence>> {
        profile.measure(&self.model, past, self.image?)
    }

    fn is_exchanged(&self, view: &BandsView) -> bool {
        self.image
            .is_some_and(|image| is_reversed(view.predicted_features, image.features))
    }

    fn fits_exchanged(&self, profile: &P, past: &Entry, fits: impl Fn(f64) -> bool) -> bool {
        let image = self.image.map(Image::exchanged);
        let exchanged = image.and_then(|image| profile.measure(&self.model, past, image));
        exchanged.is_some_and(|(other, view)| view.used == [true; 2] && fits(other.distance))
    }
}
