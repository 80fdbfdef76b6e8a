//! Most probable state of the tip for the markers of one image, and their linear measurement about it.

use crate::article::state::found;
use crate::dof::{PerDof, all_finite};
use crate::estimation::settings::StateEstimationSettings;
use crate::math::linear::{Matrix, add, dot, solve_symmetric, square};
use crate::math::whitening::{
    Features, Square, Whitener, add_matrix, add_product, diagonal, factor,
};
use crate::model::features::{FeatureModel, FeaturePrediction, GEOMETRY};

/// Gauss-Newton steps at most, and halvings of each.
const STEPS: usize = 12;
const HALVINGS: usize = 6;
/// Step in standard deviations at which the iteration ends.
const SMALL: f64 = 1e-4;
/// Weight of the prediction in the tip by the markers alone.
const ALONE: f64 = 0.04;
/// States, in standard deviations from the prediction, from which the minimum is sought again where it is bad.
const STARTS: [PerDof<f64>; 4] = [
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
];

/// Prediction of an image (prior).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagePrediction {
    /// Tip (3,) [m, rad, rad].
    pub state: PerDof<f64>,
    /// Its covariance (3, 3).
    pub covariance: Matrix,
    /// Geometry that the feature model has.
    pub geometry: [f64; GEOMETRY],
    /// Its covariance.
    pub geometry_covariance: [[f64; GEOMETRY]; GEOMETRY],
}

/// Markers (4,) of an image in px with their covariance (4, 4) in px^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Markers {
    features: Features,
    covariance: Square,
}

/// The most probable state for the markers of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerEstimate {
    /// Most probable tip (3,) [m, rad, rad].
    pub state: PerDof<f64>,
    /// Tip by the markers alone (3,) [m, rad, rad], as far as they determine it.
    pub measured: PerDof<f64>,
    /// Squared Mahalanobis distance of the innovation: what is minimised.
    pub distance_squared: f64,
    /// Sum of the squares of the misfit of both markers in px^2, where neither is left out; None if not both were found.
    pub misfit_squared: Option<f64>,
    /// Which markers were used.
    pub used: [bool; 2],
    /// Geometry that the feature model has.
    pub geometry: [f64; GEOMETRY],
    /// Derivatives (4,) of the features by it.
    pub by_geometry: [Features; GEOMETRY],
    /// Features predicted there and their interaction matrix.
    pub prediction: FeaturePrediction,
    /// Standard deviations of the state (3,) [m, rad, rad].
    pub std: PerDof<f64>,
}

/// One scalar measurement of the tip, linear in tip and geometry, whose error has the standard deviation 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipMeasurement {
    /// Derivative by the tip (3,).
    pub by_tip: PerDof<f64>,
    /// Derivative by the geometry.
    pub by_geometry: [f64; GEOMETRY],
    /// The measured value.
    pub value: f64,
}

impl MarkerEstimate {
    /// The features (4,) that were used, NaN for the others.
    pub fn keep(&self, [ua, va, ub, vb]: Features) -> Features {
        let [a, b] = self.used;
        let shown = |used: bool, value: f64| if used { value } else { f64::NAN };
        [shown(a, ua), shown(a, va), shown(b, ub), shown(b, vb)]
    }
}

impl Markers {
    /// Features (4,) in px, two NaN for a band that was not found, and their covariance (4, 4) in px^2; without one each
    /// has `marker_deviation`. The model is wrong by `model_std` in px.
    pub fn new(
        features: Features,
        covariance: Option<&Square>,
        settings: &StateEstimationSettings,
        model_std: f64,
    ) -> Self {
        let own = square(settings.marker_deviation);
        let mut covariance = covariance.copied().unwrap_or_else(|| diagonal([own; 4]));
        let model = diagonal([square(model_std); 4]);
        add_matrix(&mut covariance, &model);
        Self {
            features,
            covariance,
        }
    }

    /// The most probable state, over all choices of the markers that are used:
    ///
    /// ```text
    /// argmin_q  (q - q0)' P^-1 (q - q0) + (s - h(q))' (R + g g')^-1 (s - h(q)) + outlier_distance^2 for each marker left out
    /// ```
    ///
    /// with the prediction q0, P of the tip, R of the markers and the model, and g g' the covariance of the features by
    /// that of the geometry.
    ///
    /// None where the model sees no band.
    pub fn estimate(
        &self,
        model: &FeatureModel,
        prior: &ImagePrediction,
        outlier_distance: f64,
    ) -> Option<MarkerEstimate> {
        let seen = found(self.features);
        let price = square(outlier_distance);
        let by_geometry = model.by_geometry(prior.state)?;
        let covariance = self.with_geometry(&by_geometry, &prior.geometry_covariance);
        let problem = |used: [bool; 2]| Problem::new(self, prior, used, covariance);
        let mut best = problem(seen)?.minimum(model, [0.0; 3])?;
        if best.distance_squared > price {
            for start in STARTS {
                if let Some(other) = problem(seen)?.minimum(model, start)
                    && other.distance_squared < best.distance_squared
                {
                    best = other;
                }
            }
        }
        let is_both = seen == [true; 2];
        let misfit_squared = is_both.then(|| self.misfit_squared(&best));
        if is_both && best.distance_squared > price {
            let both = best.distance_squared;
            for used in [[true, false], [false, true]] {
                if let Some(one) = problem(used).and_then(|one| one.minimum(model, [0.0; 3]))
                    && one.distance_squared + price < both
                    && (best.used == seen || one.distance_squared < best.distance_squared)
                {
                    best = one;
                }
            }
        }
        Some(MarkerEstimate {
            misfit_squared,
            geometry: prior.geometry,
            by_geometry,
            ..best
        })
    }

    /// Covariance of the features with that of the geometry.
    fn with_geometry(
        &self,
        by_geometry: &[Features; GEOMETRY],
        geometry: &[[f64; GEOMETRY]; GEOMETRY],
    ) -> Square {
        let mut covariance = self.covariance;
        for (column, row) in by_geometry.iter().zip(geometry) {
            for (other, cross) in by_geometry.iter().zip(row) {
                for (line, value) in covariance.iter_mut().zip(column) {
                    for (entry, with) in line.iter_mut().zip(other) {
                        *entry += cross * value * with;
                    }
                }
            }
        }
        covariance
    }

    fn misfit_squared(&self, estimate: &MarkerEstimate) -> f64 {
        let features = self.features.into_iter().zip(estimate.prediction.features);
        features.map(|(measured, h)| square(measured - h)).sum()
    }

    /// The markers used by an estimate as four independent measurements, linear about it, of a tip that deviates from its plays
    /// by `std` (3,).
    pub fn linearize(
        &self,
        estimate: &MarkerEstimate,
        std: PerDof<f64>,
        geometry_covariance: &[[f64; GEOMETRY]; GEOMETRY],
    ) -> Option<[TipMeasurement; 4]> {
        let FeaturePrediction { features, columns } = estimate.prediction;
        let mut covariance = self.with_geometry(&estimate.by_geometry, geometry_covariance);
        for (column, std) in columns.iter().zip(std) {
            add_product(&mut covariance, column.map(|by| by * std));
        }
        let whitener = Whitener::new(&covariance, estimate.used)?;
        let mut value = self.features;
        for (value, predicted) in value.iter_mut().zip(features) {
            *value -= predicted;
        }
        let by_tip = columns.iter().zip(estimate.state);
        let by_geometry = estimate.by_geometry.iter().zip(estimate.geometry);
        for (column, at) in by_tip.chain(by_geometry) {
            for (value, by) in value.iter_mut().zip(column) {
                *value += by * at;
            }
        }
        let value = whitener.apply(value);
        let [q1, q2, q3] = columns.map(|column| whitener.apply(column));
        let [e1, e2, e3] = estimate.by_geometry.map(|column| whitener.apply(column));
        let mut rows = [TipMeasurement {
            by_tip: [0.0; 3],
            by_geometry: [0.0; GEOMETRY],
            value: 0.0,
        }; 4];
        let tips = q1.into_iter().zip(q2).zip(q3);
        let geometries = e1.into_iter().zip(e2).zip(e3);
        let found = tips.zip(geometries).zip(value);
        for (row, ((((a, b), c), ((d, e), f)), value)) in rows.iter_mut().zip(found) {
            *row = TipMeasurement {
                by_tip: [a, b, c],
                by_geometry: [d, e, f],
                value,
            };
        }
        Some(rows)
    }
}

/// The least squares of one choice of markers; x is the state in standard deviations: q = q0 + factor x.
struct Problem<'a> {
    markers: &'a Markers,
    prior: &'a ImagePrediction,
    factor: Matrix,
    used: [bool; 2],
    whitener: Whitener,
}

impl<'a> Problem<'a> {
    fn new(
        markers: &'a Markers,
        prior: &'a ImagePrediction,
        used: [bool; 2],
        covariance: Square,
    ) -> Option<Self> {
        Some(Self {
            markers,
            prior,
            factor: factor(&prior.covariance)?,
            used,
            whitener: Whitener::new(&covariance, used)?,
        })
    }

    fn state(&self, x: PerDof<f64>) -> PerDof<f64> {
        add(self.prior.state, 1.0, self.factor.map(|row| dot(row, x)))
    }

    fn misfit(&self, prediction: &FeaturePrediction) -> Features {
        let mut misfit = self.markers.features;
        for (value, predicted) in misfit.iter_mut().zip(prediction.features) {
            *value -= predicted;
        }
        self.whitener.apply(misfit)
    }

    fn cost(&self, x: PerDof<f64>, prediction: &FeaturePrediction) -> f64 {
        let misfit = self.misfit(prediction);
        dot(x, x) + misfit.iter().map(|value| value * value).sum::<f64>()
    }

    fn minimum(&self, model: &FeatureModel, start: PerDof<f64>) -> Option<MarkerEstimate> {
        let mut x = start;
        let mut prediction = model.predict(self.state(x))?;
        let mut cost = self.cost(x, &prediction);
        for _ in 0..STEPS {
            let Some(step) = self.step(x, &prediction) else {
                break;
            };
            let mut share = 1.0;
            let better = (0..HALVINGS).find_map(|_| {
                let trial = add(x, share, step);
                share /= 2.0;
                let there = model.predict(self.state(trial))?;
                let less = self.cost(trial, &there);
                (less <= cost).then_some((trial, there, less))
            });
            let Some(found) = better else { break };
            (x, prediction, cost) = found;
            if dot(step, step) < square(SMALL) {
                break;
            }
        }
        let (normal, _) = self.equations(x, &prediction);
        let std = self.std(normal)?;
        let measured = self.state(with_weak_prediction(x, normal)?);
        cost.is_finite().then(|| MarkerEstimate {
            state: self.state(x),
            measured,
            distance_squared: cost,
            misfit_squared: None,
            used: self.used,
            geometry: [0.0; GEOMETRY],
            by_geometry: [[0.0; 4]; GEOMETRY],
            prediction,
            std,
        })
    }

    /// Standard deviations of the state: roots of the diagonal of F N^-1 F' with the normal matrix N.
    fn std(&self, normal: Matrix) -> Option<PerDof<f64>> {
        let [first, second, third] = self.factor;
        let variance = |row: PerDof<f64>| Some(dot(row, solve_symmetric(normal, row)?));
        Some([variance(first)?, variance(second)?, variance(third)?].map(libm::sqrt))
    }

    /// Gauss-Newton step.
    fn step(&self, x: PerDof<f64>, prediction: &FeaturePrediction) -> Option<PerDof<f64>> {
        let (normal, right) = self.equations(x, prediction);
        solve_symmetric(normal, right).filter(|step| all_finite(*step))
    }

    /// Normal equations of the step.
    fn equations(&self, x: PerDof<f64>, prediction: &FeaturePrediction) -> (Matrix, PerDof<f64>) {
        let [c1, c2, c3] = prediction.columns.map(|column| self.whitener.apply(column));
        let [[f11, _, _], [f21, f22, _], [f31, f32, f33]] = self.factor;
        let mut normal = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut right = x.map(|value| -value);
        let columns = c1.into_iter().zip(c2).zip(c3);
        for (misfit, ((a, b), c)) in self.misfit(prediction).into_iter().zip(columns) {
            let row = [a * f11 + b * f21 + c * f31, b * f22 + c * f32, c * f33];
            right = add(right, misfit, row);
            for (line, entry) in normal.iter_mut().zip(row) {
                *line = add(*line, entry, row);
            }
        }
        (normal, right)
    }
}

/// Gauss-Newton step from the minimum x, with the normal matrix N there, to that with a prediction of the weight w in place
/// of 1. At the minimum the markers pull by x against the prediction: the step is (N - (1 - w) I)^-1 (1 - w) x.
fn with_weak_prediction(x: PerDof<f64>, mut normal: Matrix) -> Option<PerDof<f64>> {
    let [[a, _, _], [_, b, _], [_, _, c]] = &mut normal;
    for diagonal in [a, b, c] {
        *diagonal -= 1.0 - ALONE;
    }
    let step = solve_symmetric(normal, x.map(|value| (1.0 - ALONE) * value))?;
    Some(add(x, 1.0, step))
}
