//! What one image says, and which of it is usable.

use super::{HysteresisReduction, StateEstimation};
use crate::article::state::{StateEstimate, StateEstimator, found};
use crate::dof::{PerDof, all_finite};
use crate::estimation::posture::{half_turn, turn};
use crate::estimation::weighted::WeightedEstimator;
use crate::r#loop::history::Entry;
use crate::supervision::grip::Sighting;

/// What an image said.
pub(super) struct Seen {
    pub(super) estimate: StateEstimate,
    pub(super) used: [bool; 2],
    pub(super) predicted_features: [f64; 4],
    pub(super) state_deviation: PerDof<f64>,
    /// What the estimators of the slack are told, and its standard deviation.
    pub(super) output: PerDof<f64>,
    pub(super) output_deviation: PerDof<f64>,
}

impl Seen {
    /// The output where the image determined it, else NaN.
    pub(super) fn image_state(&self) -> PerDof<f64> {
        let mut state = self.output;
        for (value, observable) in state.iter_mut().zip(self.estimate.observable) {
            if !observable {
                *value = f64::NAN;
            }
        }
        state
    }

    /// What is seen of each DOF.
    pub(super) fn sightings(&self, past: &Entry, offsets: PerDof<(f64, f64)>) -> PerDof<Sighting> {
        let [m1, m2, m3] = self.image_state();
        let [d1, d2, d3] = self.output_deviation;
        let [c1, c2, c3] = past.command;
        let [t1, t2, t3] = past.travel;
        let [o1, o2, o3] = offsets;
        [
            (c1, t1, m1, d1, o1),
            (c2, t2, m2, d2, o2),
            (c3, t3, m3, d3, o3),
        ]
        .map(|(command, travel, tip, deviation, offsets)| Sighting {
            command,
            travel,
            tip,
            deviation,
            offsets,
        })
    }
}

/// Px^2.
const UNIT: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

/// Whether the way from one band to the other goes back rather than on, by more than 120 degrees.
pub(super) fn reversed([ua, va, ub, vb]: [f64; 4], [xa, ya, xb, yb]: [f64; 4]) -> bool {
    let (u, v, x, y) = (ub - ua, vb - va, xb - xa, yb - ya);
    let lengths = libm::sqrt((u * u + v * v) * (x * x + y * y));
    u * x + v * y < -0.5 * lengths
}

/// Whether there is a band, and what there is is finite.
pub(super) fn usable([ua, va, ub, vb]: [f64; 4]) -> bool {
    let [a, b] = found([ua, va, ub, vb]);
    (a || b) && (!a || all_finite([ua, va])) && (!b || all_finite([ub, vb]))
}

impl HysteresisReduction {
    /// What an image says; nothing is changed by it.
    pub(super) fn look(
        &self,
        past: &Entry,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Option<Seen> {
        match &self.state_estimation {
            StateEstimation::Article(estimator) => {
                self.linear_step(estimator, past, measured, covariance.unwrap_or(&UNIT))
            }
            StateEstimation::Weighted(estimator) => {
                self.most_probable(estimator, past, measured, covariance)
            }
        }
    }

    fn linear_step(
        &self,
        estimator: &StateEstimator,
        past: &Entry,
        measured: [f64; 4],
        covariance: &[[f64; 4]; 4],
    ) -> Option<Seen> {
        let used = found(measured);
        let start = if used == [true; 2] {
            past.predicted_state
        } else {
            self.whereabouts.at(past).state
        };
        let prediction = self.feature_model.predict(start)?;
        let estimate = estimator.estimate(start, &prediction, measured);
        let state_deviation = estimate.state_deviation(covariance);
        Some(Seen {
            estimate,
            used,
            predicted_features: prediction.features,
            state_deviation,
            output: estimate.state,
            output_deviation: state_deviation,
        })
    }

    fn most_probable(
        &self,
        estimator: &WeightedEstimator,
        past: &Entry,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Option<Seen> {
        let belief = self.whereabouts.at(past);
        let seen = estimator.estimate(&self.feature_model, &belief, measured, covariance)?;
        let half_turn = half_turn(belief.state, seen.estimate.state);
        Some(Seen {
            estimate: StateEstimate {
                state: turn(seen.estimate.state, half_turn),
                ..seen.estimate
            },
            used: seen.used,
            predicted_features: seen.predicted_features,
            state_deviation: seen.deviation,
            output: turn(seen.image_state, half_turn),
            output_deviation: seen.image_deviation,
        })
    }

    /// Where the instrument is from now on believed to be.
    pub(super) fn settle(&mut self, past: &Entry, seen: &Seen, measured: [f64; 4]) {
        match self.state_estimation {
            StateEstimation::Article(_) => {
                self.whereabouts
                    .learn(past, &seen.estimate, seen.state_deviation);
            }
            StateEstimation::Weighted(_) => {
                let left_out = seen.used != found(measured);
                self.whereabouts
                    .settle(past, seen.estimate.state, seen.state_deviation, left_out);
            }
        }
    }
}
