//! The image update of the loop: checks of the monitors, state estimate, offset estimates.

use crate::article::estimator::Triggers;
use crate::article::state::{StateEstimate, found};
use crate::estimation::history::Entry;
use crate::r#loop::measurement::{Measurement, is_reversed, is_usable};
use crate::r#loop::profile::{Image, ImageUpdate, Profile};
use crate::r#loop::reduction::HysteresisReduction;
use crate::r#loop::report::{Report, Status};
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::frame_gate::{FrameArrival, ImageIdentity};

impl<P: Profile, S: AsRef<[Entry]> + AsMut<[Entry]>> HysteresisReduction<P, S> {
    /// Image update: the features (4,) in px measured in a frame captured at `captured_at` in s, and their
    /// covariance (4, 4) in px^2; None is 1 px^2 for each, or `marker_deviation` of profile `best`.
    ///
    /// Two NaN mark a band that was not found; None, or any other value that is not finite, means that no band was. A
    /// `checksum` of the pixels identifies a frozen image; without it, equal features do.
    pub fn on_features(
        &mut self,
        measured: Option<[f64; 4]>,
        covariance: Option<&[[f64; 4]; 4]>,
        captured_at: f64,
        checksum: Option<u64>,
    ) -> Report {
        let past = self.history.at(captured_at);
        let mut raised = self.monitors.check_arrival(&FrameArrival {
            captured_at,
            now: self.history.newest_time(),
            image: checksum.map_or_else(
                || measured.map(|features| ImageIdentity::Features(features.map(f64::to_bits))),
                |sum| Some(ImageIdentity::Checksum(sum)),
            ),
            travel: past.map(|past| past.travel),
        });
        let mut report = self.image_update(measured, covariance, captured_at, past, &mut raised);
        self.monitors.react_to_frame(raised);
        report.supervision = self.monitors.supervision();
        report
    }

    fn image_update(
        &mut self,
        measured: Option<[f64; 4]>,
        covariance: Option<&[[f64; 4]; 4]>,
        captured_at: f64,
        past: Option<Entry>,
        raised: &mut Flags,
    ) -> Report {
        if captured_at <= self.last_used {
            *raised = self
                .monitors
                .enabled(raised.union(Flags::of(Flag::Duplicate)));
            return self.report_unused(Status::Duplicate, None);
        }
        let Some(past) = past else {
            return self.report_unused(Status::Stale, None);
        };
        if !raised.is_empty() {
            return self.report_unused(Status::Refused, Some(past));
        }
        self.profile.advance(&self.history, &past);
        let Some(features) = measured.filter(|features| is_usable(*features)) else {
            self.profile.miss(&past);
            *raised = self.monitors.enabled(Flags::of(Flag::Lost));
            return self.report_unused(Status::NoMarkers, Some(past));
        };
        let image = Image {
            features,
            covariance,
        };
        let Some(measurement) = self.profile.measure(&self.feature_model, &past, image) else {
            return self.report_unused(Status::Held, Some(past));
        };
        *raised = self.check_innovation(&past, &measurement, image);
        if !raised.is_empty() {
            // Bands that contradict the prediction for as long as a hold lasts are more credible than the prediction.
            if self.monitors.is_fading() {
                self.profile.reset_prediction(&past);
            } else {
                self.profile.miss(&past);
            }
            return self.report_unused(Status::Refused, Some(past));
        }
        self.last_used = captured_at;
        self.accept(&past, &measurement, features, raised)
    }

    /// Flags for which the image is refused.
    fn check_innovation(&self, past: &Entry, measurement: &Measurement, image: Image<'_>) -> Flags {
        let frames = &self.monitors.frames;
        let flags = frames.check_innovation(measurement.distance);
        let is_exchanged = is_reversed(measurement.predicted_features, image.features);
        if !is_exchanged && flags.is_empty() {
            return Flags::NONE;
        }
        let exchanged = self
            .profile
            .measure(&self.feature_model, past, image.exchanged());
        let is_swapped = is_exchanged
            || exchanged.is_some_and(|other| {
                other.used == [true; 2] && frames.check_innovation(other.distance).is_empty()
            });
        let swapped = self
            .monitors
            .enabled(Flags::when(is_swapped, Flag::Swapped));
        if swapped.is_empty() {
            self.monitors.enabled(flags)
        } else {
            swapped
        }
    }

    /// Updates the estimates from a measurement that has passed the checks.
    fn accept(
        &mut self,
        past: &Entry,
        measurement: &Measurement,
        features: [f64; 4],
        raised: &mut Flags,
    ) -> Report {
        let estimate = measurement.estimate;
        let status = match (measurement.used, estimate.observable) {
            ([true, false] | [false, true], _) => Status::Partial,
            ([true, true], [true, true, true]) => Status::Ok,
            _ => Status::Held,
        };
        // Of two markers with an outlier, the other one may be wrong, too.
        let has_outlier = measurement.used != found(features);
        let outlier = self
            .monitors
            .enabled(Flags::when(has_outlier, Flag::Innovation));
        let updates_offsets = outlier.is_empty() && self.monitors.permits_updates();
        let mut motion = Flags::NONE;
        if updates_offsets {
            let play = self.play();
            motion = self.monitors.check_motion(
                past.time,
                past.reference,
                measurement.observed_state(),
                play,
            );
        }
        let ImageUpdate {
            triggers,
            raised: conspicuous,
        } = self.profile.update(past, measurement, updates_offsets);
        *raised = motion.union(
            self.monitors.enabled(
                conspicuous
                    .union(Flags::when(status == Status::Partial, Flag::Merged))
                    .union(Flags::when(status == Status::Held, Flag::Unobservable)),
            ),
        );
        Report {
            status,
            predicted_state: past.predicted_state,
            predicted_features: measurement.predicted_features,
            triggers,
            estimate,
            state_deviation: measurement.state_deviation,
            play: self.play(),
            supervision: self.monitors.supervision(),
        }
    }

    /// The report on a frame that updated nothing.
    fn report_unused(&self, status: Status, past: Option<Entry>) -> Report {
        let predicted_state = past.map_or([f64::NAN; 3], |past| past.predicted_state);
        let model = self.profile.feature_model(&self.feature_model);
        let prediction = model.predict(predicted_state);
        Report {
            status,
            predicted_state,
            predicted_features: prediction.map_or([f64::NAN; 4], |prediction| prediction.features),
            estimate: StateEstimate {
                state: predicted_state,
                observable: [false; 3],
                deviation: [f64::NAN; 3],
                innovation: [f64::NAN; 4],
                inverse: [[0.0; 4]; 3],
            },
            state_deviation: [f64::NAN; 3],
            triggers: [Triggers::default(); 3],
            play: self.play(),
            supervision: self.monitors.supervision(),
        }
    }
}
