//! Update of the filter with an image, and what makes it less certain.

use crate::dof::PerDof;
use crate::estimation::ensemble::{STATE, ScalarMeasurement};
use crate::estimation::filter::Filter;
use crate::estimation::history::{Entry, History};
use crate::estimation::marker_measurement::{
    ImagePrediction, MarkerEstimate, Markers, TipMeasurement,
};
use crate::estimation::nominal::Nominal;
use crate::estimation::posture::Belief;
use crate::estimation::tip_regression::PlayReading;
use crate::model::features::{FeatureModel, GEOMETRY};

/// Standard deviation of the tip, in `start_deviation`, up to which images without markers make it uncertain, and by
/// how much each does.
const MISSED: f64 = 0.15;
const MISS: f64 = 0.03;
/// Error of the feature model that a reset assumes, in `model_deviation`, and the most images over which its square is averaged.
const RESET_MODEL: f64 = 30.0;
const MODEL_IMAGES: f64 = 200.0;
/// Largest squared misfit of an image that it is adapted to, in variances: a wrong band is in one image, a wrong geometry in
/// all.
const MISFIT: f64 = 25.0;

/// Travel of the reference, in half of `width_limit`, within which the tip deviates from its plays alike.
const CORRELATED: f64 = 0.015;
/// The same for the geometry, in travel of bending.
const GEOMETRY_CORRELATED: f64 = 0.1;
/// Share of the update of the hysteresis by an image at rest.
const AT_REST: f64 = 0.1;

/// Share of the tip's residual that an image tells, and the largest residual in half of `width_limit`.
const TOLD: f64 = 0.5;
const LARGEST_RESIDUAL: f64 = 0.04;

impl Filter {
    /// Markers (4,) of an image in px, with their covariance (4, 4) in px^2.
    pub fn markers(&self, features: [f64; 4], covariance: Option<&[[f64; 4]; 4]>) -> Markers {
        Markers::new(features, covariance, &self.settings, self.model_std)
    }

    /// The most probable tip for the markers of an image at the time of the ensemble; None where the model sees no band.
    pub fn measure(&self, model: &FeatureModel, markers: &Markers) -> Option<MarkerEstimate> {
        self.origin?;
        let (geometry, _) = self.geometry();
        let geometry_covariance = self.geometry_covariance();
        let (state, covariance) = self.tips();
        let prior = ImagePrediction {
            state,
            covariance,
            geometry,
            geometry_covariance,
        };
        markers.estimate(model, &prior, self.settings.outlier_distance)
    }

    /// The part of the geometry's covariance that counts as noise of this image: covariance * bent / (bent + 0.1), where bent
    /// is the travel of bending since the last image, in half of `width_limit`. Without it, the position includes the error
    /// already.
    fn geometry_covariance(&self) -> [[f64; GEOMETRY]; GEOMETRY] {
        let (_, mut covariance) = self.geometry();
        let [_, _, bent] = self.travel;
        for entry in covariance.iter_mut().flatten() {
            *entry *= bent / (bent + GEOMETRY_CORRELATED);
        }
        covariance
    }

    /// Updates the ensemble with the markers of an estimate by [`Filter::measure`]; with `is_position_only` only the tip.
    pub fn update<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &mut self,
        history: &History<S>,
        markers: &Markers,
        estimate: &MarkerEstimate,
        is_position_only: bool,
    ) {
        let geometry_covariance = self.geometry_covariance();
        let Some(measurements) =
            markers.linearize(estimate, self.deviation(), &geometry_covariance)
        else {
            return;
        };
        self.update_with(&measurements, estimate.measured, is_position_only);
        if let Some(misfit) = estimate.misfit_squared {
            // Four features determine three DOFs: what is left is the error of one.
            let variance = self.model_std * self.model_std;
            self.model_images = (self.model_images + 1.0).min(MODEL_IMAGES);
            let change = (misfit.min(MISFIT * variance) - variance) / self.model_images;
            let least = self.settings.model_deviation;
            self.model_std = libm::sqrt(variance + change).max(least);
        }
        self.catch_up(history);
    }

    /// Updates ensemble and regression at the time of the ensemble with measurements of the tip, which is at `tip` (3,)
    /// [m, rad, rad]; with `is_position_only` only the tip.
    pub fn update_with(
        &mut self,
        measurements: &[TipMeasurement],
        tip: PerDof<f64>,
        is_position_only: bool,
    ) {
        // Images within a short travel have the same error.
        let [t1, t2, t3] = self.travel;
        let share = |travel: f64| {
            if is_position_only {
                0.0
            } else {
                (travel + AT_REST * CORRELATED) / (travel + CORRELATED)
            }
        };
        let shares = [share(libm::sqrt(t1 * t1 + t2 * t2)), share(t3)];
        for measurement in measurements {
            let of_plays = self.of_plays(measurement);
            self.ensemble.update(&of_plays, shares);
        }
        if !is_position_only {
            self.update_regression(measurements);
            self.update_maps();
        }
        self.travel = [0.0; 3];
        self.settle();
        if !is_position_only {
            self.update_residual(tip);
        }
    }

    /// Makes tip and centres as uncertain as at the start, about their means, and the feature model uncertain by many px, so
    /// that the next images determine them: a tip that was pushed has another centre.
    pub fn reset_position(&mut self) {
        let Belief { deviation, .. } = self.belief();
        let mut missing = self.start_std;
        for (missing, std) in missing.iter_mut().zip(deviation) {
            *missing = libm::sqrt((*missing * *missing - std * std).max(0.0));
        }
        self.ensemble.disturb_position(missing);
        let [h1, h2, h3] = self.nominal.hysteresis.half_width;
        let offset = self.settings.centre_deviation;
        let mut std = [0.0; STATE];
        let [_, _, _, _, _, _, _, _, c1, c2, c3, ..] = &mut std;
        (*c1, *c2, *c3) = (offset * h1, offset * h2, offset * h3);
        self.ensemble.add_noise(&std);
        self.regression.forget_constants();
        self.residual = [0.0; 3];
        self.model_std = RESET_MODEL * self.settings.model_deviation;
    }

    /// Makes the tip a little less certain, after an image without markers.
    pub fn miss(&mut self) {
        let Belief { deviation, .. } = self.belief();
        let mut step = self.start_std;
        for (step, std) in step.iter_mut().zip(deviation) {
            *step = if std < MISSED * *step {
                MISS * *step
            } else {
                0.0
            };
        }
        self.ensemble.disturb_position(step);
    }

    /// A measurement of the tip as one of the plays, with the gain, their lag and the geometry as estimated.
    fn of_plays(&self, measurement: &TipMeasurement) -> ScalarMeasurement {
        let Nominal { gain, origin, .. } = self.nominal;
        let (geometry, _) = self.geometry();
        let mut value = measurement.value;
        for (by, error) in measurement.by_geometry.iter().zip(geometry) {
            value -= by * error;
        }
        let (mut output, mut lag) = (measurement.by_tip, measurement.by_tip);
        let dofs = output.iter_mut().zip(&mut lag);
        let parts = gain.into_iter().zip(origin).zip(self.velocity);
        for ((output, lag), ((gain, origin), velocity)) in dofs.zip(parts) {
            value -= *output * origin * (1.0 - gain);
            *output *= gain;
            *lag = -*output * velocity;
        }
        ScalarMeasurement { output, lag, value }
    }

    fn update_regression(&mut self, measurements: &[TipMeasurement]) {
        let Some(origin) = self.origin else {
            return;
        };
        let mut reading = PlayReading {
            output: self.uncorrected.output,
            deflection: self.command,
        };
        let plays = reading.output.iter_mut().zip(&mut reading.deflection);
        for ((output, deflection), (unit, origin)) in plays.zip(self.unit.into_iter().zip(origin)) {
            *deflection = (*deflection - *output) / unit;
            *output = (*output - origin) / unit;
        }
        let Nominal { gain, lag, .. } = self.nominal;
        let mut late = self.velocity;
        for (late, (gain, lag)) in late.iter_mut().zip(gain.into_iter().zip(lag)) {
            *late *= gain * lag;
        }
        self.regression
            .update(measurements, &reading, late, self.unit, origin);
        self.nominal.gain = self.regression.gain();
    }

    /// What the updated plays leave of a tip (3,) [m, rad, rad]. The ensemble takes it for noise: it says little of the plays,
    /// but is alike in the next images.
    fn update_residual(&mut self, tip: PerDof<f64>) {
        let (mean, _) = self.tips();
        let left = tip.into_iter().zip(mean).zip(self.unit);
        for (residual, ((tip, mean), unit)) in self.residual.iter_mut().zip(left) {
            let largest = LARGEST_RESIDUAL * unit;
            *residual += TOLD * (tip - mean - *residual);
            *residual = residual.clamp(-largest, largest);
        }
        self.nominal.residual = self.residual;
    }

    /// Passes a share of the mean centre on to the map at the position of the tip.
    fn update_maps(&mut self) {
        let mean = self.ensemble.mean();
        let [q1, q2, q3, _, _, _, _, _, m1, m2, m3, ..] = mean;
        let rates = self.settings.map_rate.into_iter().zip(self.travel);
        let mut changes = [m1, m2, m3];
        let maps = self.maps.iter_mut().zip([q1, q2, q3]).zip(rates);
        for (change, ((map, position), (rate, travel))) in changes.iter_mut().zip(maps) {
            *change *= (rate * travel).min(0.5);
            map.add(position, *change);
        }
        self.ensemble.shift_centres(changes);
    }
}
