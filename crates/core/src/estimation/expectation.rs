//! Predicted places and shapes of the bands, before an image and with its features.

use nalgebra::{SMatrix, SVector};

use crate::dof::PerDof;
use crate::estimation::measurement::{Observed, Prior, Sensor};
use crate::math::linear::square;
use crate::model::features::FeatureModel;
use crate::model::geometry_error::{ERRORS, GeometryDeviation};
use crate::model::outline::BandImage;

/// States from which the best is sought.
const STARTS: usize = 3;

/// Normal distribution of the state before a measurement, each DOF independent of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatePrior<const N: usize = 3> {
    /// Most probable state (N,) [m or rad].
    pub state: [f64; N],
    /// Standard deviations (N,) [m or rad].
    pub deviation: [f64; N],
}

/// The feature model with errors (8,) of its geometry, in their standard deviations.
struct Displaced<'a> {
    model: &'a FeatureModel,
    deviation: GeometryDeviation,
}

impl Sensor<3, 4, ERRORS> for Displaced<'_> {
    fn point(&self) -> usize {
        2
    }

    fn features(
        &self,
        state: &[f64; 3],
        errors: &[f64; ERRORS],
    ) -> Option<([f64; 4], [[f64; 4]; 3])> {
        let model = self.model.displaced(&self.deviation, *errors);
        let predicted = model.predict(*state)?;
        Some((predicted.features, predicted.columns))
    }

    fn by_geometry(&self, state: &[f64; 3], _: &[f64; ERRORS]) -> Option<[[f64; 4]; ERRORS]> {
        self.model.by_displacement(*state, &self.deviation)
    }
}

impl StatePrior {
    /// With the errors of the geometry, in their standard deviations.
    fn with_geometry(&self) -> Prior<3, ERRORS> {
        Prior {
            state: self.state.into(),
            covariance: SMatrix::from_diagonal(&self.deviation.map(square).into()),
            geometry: SVector::zeros(),
            slope: SMatrix::zeros(),
            geometry_covariance: SMatrix::identity(),
        }
    }
}

/// Features (4,) in px with independent errors of standard deviations (4,) in px; one of infinite deviation, or that is not
/// finite, says nothing.
fn observed(features: [f64; 4], deviation: [f64; 4]) -> Observed<4> {
    let is_seen = |(feature, deviation): (f64, f64)| (feature + deviation).is_finite();
    let [a, b, c, d] = features;
    let [da, db, dc, dd] = deviation;
    Observed {
        features: features.into(),
        covariance: SMatrix::from_diagonal(&deviation.map(square).into()),
        seen: [(a, da), (b, db), (c, dc), (d, dd)].map(is_seen),
    }
}

/// Distribution of the instrument's state before an image: about one of several states, equally likely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatePriors<'a> {
    /// Each (3,) [m, rad, rad]. Several stand for a workspace, in which no place is surprising.
    pub states: &'a [PerDof<f64>],
    /// Standard deviations of each (3,) [m, rad, rad].
    pub deviation: PerDof<f64>,
    /// Of a band from where the model has it: standard deviation (px).
    pub model_deviation: f64,
    /// How far camera and bands may be from where they are configured.
    pub geometry: GeometryDeviation,
}

/// What the model says of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Where the prior has the bands' centroids, `[u_A, v_A, u_B, v_B]` (px).
    pub features: [f64; 4],
    /// Their covariance (4, 4) (px^2).
    pub covariance: [[f64; 4]; 4],
    /// The posture that best explains what was seen (3,) [m, rad, rad].
    pub state: PerDof<f64>,
    /// The bands in it.
    pub bands: [BandImage; 2],
    /// The model with the errors of its geometry that best explain what was seen.
    pub model: FeatureModel,
}

impl FeatureModel {
    /// The most probable state (3,), and its squared Mahalanobis distance from prior and features, for features (4,) with
    /// standard deviations (4,) in px: a Gauss-Newton with each step halved while it makes things worse.
    ///
    /// A feature of infinite deviation, or that is not finite, says nothing. None where the model sees no band. Wrong in another
    /// valley than the prior's.
    #[must_use]
    pub fn nearest_state(
        &self,
        prior: &StatePrior,
        features: [f64; 4],
        deviation: [f64; 4],
    ) -> Option<(PerDof<f64>, f64)> {
        let exact = Displaced {
            model: self,
            deviation: GeometryDeviation::EXACT,
        };
        nearest(&exact, prior, &observed(features, deviation))
    }

    /// What to expect of an image in which features (4,) in px were seen with standard deviations (4,) in px:
    ///
    /// ```text
    /// q = the likeliest posture by `nearest_state`, over the states q0 of the prior
    /// features = h(q) + L(q) (q0 - q);    covariance = L diag(deviation^2) L' + model_deviation^2 I + G(q)
    /// ```
    ///
    /// with the covariance G by errors of the geometry ([`GeometryDeviation`]), which the posture leaves to be explained by them.
    /// A feature of infinite deviation, or that is not finite, says nothing. With several states q0 is q.
    ///
    /// None where the model sees no band from any of the states, nor one deviation beside a single one.
    #[must_use]
    pub fn expect(
        &self,
        priors: &StatePriors<'_>,
        seen: [f64; 4],
        deviation: [f64; 4],
    ) -> Option<Expected> {
        let sensor = Displaced {
            model: self,
            deviation: priors.geometry,
        };
        let seen = observed(seen, deviation);
        let (assumed, posture) = sensor.likeliest(priors, &seen)?;
        let there = StatePrior {
            state: posture,
            deviation: priors.deviation,
        }
        .with_geometry();
        let errors = seen.geometry(&sensor, &there)?;
        let model = self.displaced(&priors.geometry, errors);
        let columns = SMatrix::<f64, 4, 3>::from(self.predict(posture)?.columns);
        let by_geometry =
            SMatrix::<f64, 4, ERRORS>::from(self.by_displacement(posture, &priors.geometry)?);
        let own = SMatrix::<f64, 4, 4>::from_diagonal_element(square(priors.model_deviation));
        let covariance = columns * there.covariance * columns.transpose()
            + by_geometry * by_geometry.transpose()
            + own;
        let [[ua, va], [ub, vb]] = self.bands(posture)?.map(|band| band.centroid);
        let features =
            SVector::from([ua, va, ub, vb]) + columns * (SVector::from(assumed) - there.state);
        Some(Expected {
            features: features.into(),
            covariance: covariance.into(),
            state: posture,
            bands: model.bands(posture)?,
            model,
        })
    }
}

/// The most probable state and its squared distance.
fn nearest(
    sensor: &Displaced<'_>,
    prior: &StatePrior,
    seen: &Observed<4>,
) -> Option<(PerDof<f64>, f64)> {
    let found = seen.most_probable(
        sensor,
        &prior.with_geometry(),
        core::iter::empty(),
        f64::INFINITY,
    )?;
    Some((found.state, found.distance_squared))
}

impl Displaced<'_> {
    /// A state of the prior, and the posture to which it leads.
    fn likeliest(
        &self,
        priors: &StatePriors<'_>,
        seen: &Observed<4>,
    ) -> Option<(PerDof<f64>, PerDof<f64>)> {
        let prior = |state| StatePrior {
            state,
            deviation: priors.deviation,
        };
        // The states that explain the features best as they are; one of them leads to the best of all.
        let mut starts: [Option<(f64, PerDof<f64>)>; STARTS] = [None; STARTS];
        let mut consider = |state: PerDof<f64>| {
            let misfit = seen.distance_squared(self, &prior(state).with_geometry());
            let mut moved = misfit.map(|misfit| (misfit, state));
            for place in &mut starts {
                if let Some((misfit, _)) = moved
                    && place.is_none_or(|(least, _)| misfit < least)
                {
                    core::mem::swap(place, &mut moved);
                }
            }
        };
        priors.states.iter().copied().for_each(&mut consider);
        if let [[q1, q2, q3]] = *priors.states
            && self.model.predict([q1, q2, q3]).is_none()
        {
            // No band can be seen from there; but it need not be exactly there.
            let [d1, d2, d3] = priors.deviation;
            for side in [-1.0, 1.0] {
                consider([q1 + side * d1, q2, q3]);
                consider([q1, q2 + side * d2, q3]);
                consider([q1, q2, q3 + side * d3]);
            }
        }
        let found = starts.iter().flatten().filter_map(|(_, state)| {
            let (posture, misfit) = nearest(self, &prior(*state), seen)?;
            Some((*state, posture, misfit))
        });
        let (assumed, posture, _) = found.min_by(|a, b| a.2.total_cmp(&b.2))?;
        let anywhere = priors.states.len() > 1;
        Some((if anywhere { posture } else { assumed }, posture))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::camera::{Camera, Pose};
    use crate::model::instrument::Instrument;

    fn model(translation: [f64; 3], rotation: [f64; 3], bands: [f64; 2]) -> FeatureModel {
        let [a, b] = bands;
        FeatureModel::new(
            Instrument::new(18.5e-3, a, b, 1.75e-3, 4e-3).unwrap(),
            Camera::new([520.0, 540.0], [360.0, 288.0], [0.0; 8]).unwrap(),
            Pose::new(translation, rotation).unwrap(),
        )
    }

    /// Two models whose geometry differs: the one explains what the other predicts, and better than without.
    #[test]
    fn errors_explain_the_features_of_another_geometry() {
        let told = model([5e-3, 4e-3, 12e-3], [0.1, -0.05, 0.3], [5e-3, 15e-3]);
        let actual = model([6e-3, 3e-3, 13e-3], [0.12, -0.03, 0.3], [5.2e-3, 14.8e-3]);
        let sensor = Displaced {
            model: &told,
            deviation: GeometryDeviation {
                shift: 1e-3,
                turn: 0.02,
                band: 0.3e-3,
            },
        };
        for state in [[20e-3, 0.4, 1.2], [30e-3, -1.9, 0.4], [15e-3, 2.0, -0.8]] {
            let seen = actual.predict(state).unwrap().features;
            let prior = StatePrior {
                state,
                deviation: [1e-3; 3],
            };
            let found = observed(seen, [0.3; 4]).geometry(&sensor, &prior.with_geometry());
            let explained = told.displaced(&sensor.deviation, found.unwrap());
            let away = |model: &FeatureModel| {
                let found = model.predict(state).unwrap().features;
                let squares = found.iter().zip(seen).map(|(a, b)| (a - b).powi(2));
                squares.sum::<f64>().sqrt()
            };
            assert!(
                away(&told) > 20.0 && away(&explained) < 0.1 * away(&told),
                "{state:?}"
            );
        }
    }

    /// The columns are the differences of the features of moved models; the centroid of a band and the image of its centre
    /// move nearly alike.
    #[test]
    fn columns_are_derivatives() {
        let at = model([5e-3, 4e-3, 12e-3], [0.1, -0.05, 0.3], [5e-3, 15e-3]);
        let deviation = GeometryDeviation {
            shift: 1e-5,
            turn: 1e-4,
            band: 1e-5,
        };
        let state = [20e-3, 0.4, 1.2];
        let columns = at.by_displacement(state, &deviation).unwrap();
        for (index, column) in columns.into_iter().enumerate() {
            let mut one = [0.0; ERRORS];
            one[index] = 1.0;
            let moved = at.displaced(&deviation, one);
            let before = at.predict(state).unwrap().features;
            let after = moved.predict(state).unwrap().features;
            let size = column.iter().map(|value| value.abs()).fold(0.0, f64::max);
            for ((after, before), by) in after.into_iter().zip(before).zip(column) {
                assert!((after - before - by).abs() < 0.15 * size, "{index} {by}");
            }
        }
    }
}
