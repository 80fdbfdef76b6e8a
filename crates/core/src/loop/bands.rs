//! Profile `best` of the article's instrument: what it sees of the bands.

use nalgebra::{SMatrix, SVector};

use crate::article::play_limit::PlayLimit;
use crate::article::state::{StateEstimate, found};
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::estimate::GeometryPrior;
use crate::estimation::expectation::StatePrior;
use crate::estimation::history::{Entry, History};
use crate::estimation::measurement::{Observed, Sensor};
use crate::r#loop::best::{Best, ERRORS};
use crate::r#loop::measurement::Measurement;
use crate::r#loop::paper::state_estimator;
use crate::r#loop::profile::{BandProfile, BandsView, Image, Seen};
use crate::r#loop::report::GeometryEstimate;
use crate::r#loop::settings::LoopSettings;
use crate::model::features::{FeatureModel, FeaturePrediction};

/// Limits of the low-passed error of the predicted tip, in units.
const SLACK_CHANGED: PerDof<f64> = [0.13, 0.3, 0.13];

/// Features (4,) of the bands with errors of the geometry: unevenness of the section, shift of the image (2,) in px, and what
/// else the feature model errs (4,) in px.
impl Sensor<3, 4, ERRORS> for FeatureModel {
    fn point(&self) -> usize {
        2
    }

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

impl BandProfile for Best {
    fn new(settings: &LoopSettings<3>, limits: PerDof<PlayLimit>) -> Result<Self, ConfigError> {
        let own = settings.estimation;
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
        state_estimator(&settings.dofs)?;
        Self::with_geometry(settings, limits, geometry, SLACK_CHANGED)
    }

    fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
        past: &Entry,
    ) -> StatePrior {
        let plays = self.plays_at(history, past);
        let mut ahead = self.estimate.clone();
        ahead.advance(plays.travel);
        let prior = ahead.prior(&plays);
        StatePrior {
            state: prior.state.into(),
            deviation: prior.covariance.diagonal().map(libm::sqrt).into(),
        }
    }

    fn measure(
        &self,
        model: &FeatureModel,
        _: &Entry,
        image: Image<'_>,
    ) -> Option<Seen<Self::Evidence>> {
        let prior = self.estimate.prior(&self.measured);
        let observed = self.observed(image);
        let outlier = self.settings.outlier_distance;
        let markers = observed.most_probable(model, &prior, mirrored(), outlier)?;
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
        let about = state_estimator(&self.dofs)
            .ok()?
            .estimate(markers.state, &prediction, kept);
        let [a, _, b, _] = markers.used;
        let used = [a, b];
        let estimate = StateEstimate {
            state: markers.state,
            innovation,
            ..about
        };
        let measurement = Measurement {
            state: estimate.state,
            observable: estimate.observable,
            distance: libm::sqrt(markers.distance_squared),
            is_partial: a != b,
            has_outlier: used != found(image.features),
            evidence: linear,
        };
        let view = BandsView {
            estimate,
            used,
            predicted_features: expected,
            state_deviation: markers.std,
        };
        Some((measurement, view))
    }

    fn geometry(&self) -> Option<GeometryEstimate> {
        let ([unevenness, u, v, ..], [_, u_std, v_std, ..]) = self.estimate.geometry();
        Some(GeometryEstimate {
            shared: self.estimate.shared(),
            unevenness,
            image_shift: [u, v],
            image_shift_std: [u_std, v_std],
        })
    }
}

/// A standard deviation of rotation or bending to either side, in the coordinates of the factor of a covariance: postures that
/// look alike are apart by these.
fn mirrored() -> impl Iterator<Item = SVector<f64, 3>> {
    let start = |rotation, bending| SVector::from([0.0, rotation, bending]);
    [
        start(1.0, 0.0),
        start(-1.0, 0.0),
        start(0.0, 1.0),
        start(0.0, -1.0),
    ]
    .into_iter()
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
}
