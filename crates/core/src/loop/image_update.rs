//! The image update of the loop: checks of the monitors, state estimate, offset estimates.

use crate::article::estimator::Triggers;
use crate::article::state::{StateEstimate, found};
use crate::dof::PerDof;
use crate::estimation::history::Entry;
use crate::r#loop::axis::Axis;
use crate::r#loop::measurement::{Measurement, is_reversed, is_usable};
use crate::r#loop::profile::Profile;
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
        let Some(measured) = measured.filter(|features| is_usable(*features)) else {
            self.whereabouts.miss(&past);
            self.monitors.frames.miss(past.travel);
            *raised = self.monitors.enabled(Flags::of(Flag::Lost));
            return self.report_unused(Status::NoMarkers, Some(past));
        };
        let Some(measurement) = self.measure(&past, measured, covariance) else {
            return self.report_unused(Status::Held, Some(past));
        };
        *raised = self.check_innovation(&past, &measurement, measured, covariance);
        if !raised.is_empty() {
            self.whereabouts.miss(&past);
            return self.report_unused(Status::Refused, Some(past));
        }
        self.last_used = captured_at;
        self.accept(&past, &measurement, measured, raised)
    }

    fn measure(
        &self,
        past: &Entry,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Option<Measurement> {
        self.profile.measure(
            &self.feature_model,
            &self.whereabouts,
            past,
            measured,
            covariance,
        )
    }

    /// Flags for which the image is refused.
    fn check_innovation(
        &self,
        past: &Entry,
        measurement: &Measurement,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Flags {
        let prior = self.whereabouts.at(past);
        let moved = self.whereabouts.moved(past);
        let offsets = self.offsets();
        let check = |measurement: &Measurement| {
            let sightings = measurement.sightings(past, offsets);
            let frames = &self.monitors.frames;
            frames
                .check_innovation(&prior, moved, &sightings)
                .difference(P::UNCHECKED)
        };
        let flags = check(measurement);
        let is_used = measurement.used != [false; 2];
        let expected = self.feature_model.predict(prior.state);
        let is_exchanged =
            expected.is_some_and(|expected| is_reversed(expected.features, measured));
        if !is_exchanged && is_used && flags.is_empty() {
            return Flags::NONE;
        }
        let [ua, va, ub, vb] = measured;
        let exchanged = self.measure(past, [ub, vb, ua, va], covariance);
        let is_swapped = is_exchanged
            || exchanged.is_some_and(|other| other.used == [true; 2] && check(&other).is_empty());
        let swapped = self
            .monitors
            .enabled(Flags::when(is_swapped, Flag::Swapped));
        if swapped.is_empty() && is_used {
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
        measured: [f64; 4],
        raised: &mut Flags,
    ) -> Report {
        let prior = self.whereabouts.at(past);
        let sightings = measurement.sightings(past, self.offsets());
        self.monitors.frames.accept(&prior, &sightings);
        self.profile
            .update_prediction(&mut self.whereabouts, past, measurement, measured);
        let estimate = measurement.estimate;
        let status = match (measurement.used, estimate.observable) {
            ([true, false] | [false, true], _) => Status::Partial,
            ([true, true], [true, true, true]) => Status::Ok,
            _ => Status::Held,
        };
        let is_used = measurement.used != [false; 2];
        // Of two markers with an outlier, the other one may be wrong, too.
        let has_outlier = is_used && measurement.used != found(measured);
        let outlier = self
            .monitors
            .enabled(Flags::when(has_outlier, Flag::Innovation));
        let triggers = if outlier.is_empty() && self.monitors.permits_updates() {
            self.update_offsets(past, measurement, raised)
        } else {
            [Triggers::default(); 3]
        };
        *raised = self.monitors.enabled(
            raised
                .union(Flags::when(status == Status::Partial, Flag::Merged))
                .union(Flags::when(!is_used, Flag::Lost))
                .union(Flags::when(
                    is_used && status == Status::Held,
                    Flag::Unobservable,
                )),
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

    /// Updates the offsets of the observable DOFs and raises flags for conspicuous changes.
    fn update_offsets(
        &mut self,
        past: &Entry,
        measurement: &Measurement,
        raised: &mut Flags,
    ) -> PerDof<Triggers> {
        let play = self.play();
        let motion = self.monitors.check_motion(
            past.time,
            past.reference,
            measurement.observed_output(),
            play,
        );
        *raised = raised.union(motion);
        let mut triggers = [Triggers::default(); 3];
        let mut changes = [[0.0; 2]; 3];
        let history = &self.history;
        let outputs = measurement.output.iter().zip(measurement.output_deviation);
        let observable = measurement.estimate.observable;
        let signals = observable.iter().zip(past.command).zip(outputs);
        let results = triggers.iter_mut().zip(&mut changes);
        let axes = self.profile.axes_mut().iter_mut().zip(results);
        let axes = axes.zip(&mut self.corrected).zip(signals).enumerate();
        for (dof, (((axis, results), corrected), ((observable, command), (output, deviation)))) in
            axes
        {
            if !observable {
                continue;
            }
            let since = history
                .since(past.time)
                .filter_map(|entry| entry.command.get(dof).copied());
            let before = axis.predicted_state();
            let update = axis.update_within_limit(command, *output, deviation, since);
            (*results.0, *results.1) = (update.triggers, update.change);
            *raised = raised.union(Flags::when(update.is_limited, Flag::WidthLimit));
            let moved = axis.predicted_state() - before;
            *corrected += if moved.is_finite() { moved } else { 0.0 };
        }
        *raised = raised.union(self.monitors.check_changes(changes, past.travel));
        triggers
    }

    fn offsets(&self) -> PerDof<(f64, f64)> {
        self.profile.axes().each_ref().map(Axis::offsets)
    }

    /// The report on a frame that updated nothing.
    fn report_unused(&self, status: Status, past: Option<Entry>) -> Report {
        let predicted_state = past.map_or([f64::NAN; 3], |past| past.predicted_state);
        let prediction = self.feature_model.predict(predicted_state);
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
