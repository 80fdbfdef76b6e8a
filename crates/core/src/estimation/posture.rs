//! From features back to the state: the posture that explains what is seen.

use core::f64::consts::{FRAC_PI_2, PI};

use crate::dof::{PerDof, all_finite};
use crate::math::linear::{solve_symmetric, square};
use crate::math::whitening::{Features, Square, Whitener, add_matrix, diagonal};
use crate::model::features::{FeatureModel, FeaturePrediction};

const STEPS: usize = 8;

/// What is believed of the state before an image is looked at: normal, each DOF by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief<const N: usize = 3> {
    /// Most probable state (N,) [m or rad].
    pub state: [f64; N],
    /// Standard deviations (N,) [m or rad].
    pub deviation: [f64; N],
}

/// By how much to [`turn`] a state, in rad, for the name of its posture that is nearer to an expected one; 0: not.
///
/// Wrong where the rotation is expected a quarter of a turn off.
pub fn half_turn(expected: PerDof<f64>, state: PerDof<f64>) -> f64 {
    let ([_, expected, _], [_, rotation, _]) = (expected, state);
    let away = rotation - expected;
    if away.abs() > FRAC_PI_2 {
        -PI.copysign(away)
    } else {
        0.0
    }
}

/// The same posture by another name, `half_turn` being pi, -pi or 0; images never tell them apart:
///
/// ```text
/// (q1, q2, q3) = (q1, q2 + pi, -q3) = (q1, q2 - pi, -q3)
/// ```
pub fn turn([insertion, rotation, bending]: PerDof<f64>, half_turn: f64) -> PerDof<f64> {
    let side = if half_turn.abs() > 0.0 { -1.0 } else { 1.0 };
    [insertion, rotation + half_turn, side * bending]
}

/// Features (4,) of an image in px, and what whitens their errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    features: Features,
    whitener: Whitener,
}

impl Observation {
    /// Features (4,) in px with independent errors of standard deviations (4,) in px; one of infinite deviation, or that is not
    /// finite, says nothing.
    pub fn new(features: Features, mut deviation: Features) -> Self {
        for (deviation, feature) in deviation.iter_mut().zip(features) {
            if !feature.is_finite() {
                *deviation = f64::INFINITY;
            }
        }
        Self {
            features,
            whitener: Whitener::independent(deviation),
        }
    }

    /// With another error of a covariance (4, 4) in px^2, which is not 0.
    pub fn and_error(
        features: Features,
        deviation: Features,
        mut covariance: Square,
    ) -> Option<Self> {
        let known = |index: usize| {
            let of = |values: Features| values.get(index).is_some_and(|value| value.is_finite());
            of(features) && of(deviation)
        };
        let used = [known(0) && known(1), known(2) && known(3)];
        add_matrix(&mut covariance, &diagonal(deviation.map(square)));
        Some(Self {
            features,
            whitener: Whitener::new(&covariance, used)?,
        })
    }

    /// What whitens the errors.
    pub(crate) const fn whitener(&self) -> &Whitener {
        &self.whitener
    }

    /// Features less the predicted ones.
    pub(crate) fn innovation(&self, prediction: &FeaturePrediction) -> Features {
        let mut innovation = self.features;
        for (value, h) in innovation.iter_mut().zip(prediction.features) {
            *value -= h;
        }
        innovation
    }

    fn misfit(&self, prediction: &FeaturePrediction) -> Features {
        self.whitener.apply(self.innovation(prediction))
    }
}

impl FeatureModel {
    /// The most probable state, and what is minimised, for an observation with the whitener W:
    ///
    /// ```text
    /// argmin  |W (h(q) - s)|^2 + sum_j ((q_j - belief_j) / deviation_j)^2
    /// ```
    ///
    /// by at most eight Gauss-Newton steps, each halved while it makes things worse.
    ///
    /// It is for where and how large the bands should be; the loop's state estimate is Eq. (16), one step.
    /// None where the model sees no band. Wrong in another valley than the belief's.
    pub fn nearest_state(
        &self,
        belief: &Belief,
        observed: &Observation,
    ) -> Option<(PerDof<f64>, f64)> {
        let mut state = belief.state;
        let mut cost = self.misfit(belief, state, observed)?;
        for _ in 0..STEPS {
            let step = self.gauss_newton(belief, state, observed)?;
            let mut share = 1.0;
            let better = loop {
                let mut trial = state;
                for (value, step) in trial.iter_mut().zip(step) {
                    *value += share * step;
                }
                match self.misfit(belief, trial, observed) {
                    Some(less) if less < cost => break Some((trial, less)),
                    _ => share /= 2.0,
                }
                if share < 0.05 {
                    break None;
                }
            };
            let Some((trial, less)) = better else { break };
            let gained = cost - less;
            (state, cost) = (trial, less);
            if gained < 1e-3 * cost + 1e-6 {
                break;
            }
        }
        Some((state, cost))
    }

    /// What `nearest_state` minimises, for a state.
    pub(crate) fn misfit(
        &self,
        belief: &Belief,
        state: PerDof<f64>,
        observed: &Observation,
    ) -> Option<f64> {
        let misfit = observed.misfit(&self.predict(state)?).map(square);
        let believed = state.iter().zip(belief.state).zip(belief.deviation);
        let cost = misfit.iter().sum::<f64>()
            + believed
                .map(|((q, q0), d)| square((q - q0) / d))
                .sum::<f64>();
        cost.is_finite().then_some(cost)
    }

    /// In units of the belief's deviations the prior's normal matrix is the identity.
    fn gauss_newton(
        &self,
        belief: &Belief,
        state: PerDof<f64>,
        observed: &Observation,
    ) -> Option<PerDof<f64>> {
        let prediction = self.predict(state)?;
        let mut normal = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut right = [0.0; 3];
        let mut columns = prediction.columns;
        for ((((right, column), q), q0), scale) in right
            .iter_mut()
            .zip(&mut columns)
            .zip(state)
            .zip(belief.state)
            .zip(belief.deviation)
        {
            *right = (q0 - q) / scale;
            *column = observed.whitener.apply(column.map(|by| by * scale));
        }
        let [c1, c2, c3] = columns;
        let rows = c1.into_iter().zip(c2).zip(c3);
        for (((a, b), c), misfit) in rows.zip(observed.misfit(&prediction)) {
            let row = [a, b, c];
            for ((line, right), own) in normal.iter_mut().zip(&mut right).zip(row) {
                *right += own * misfit;
                for (entry, other) in line.iter_mut().zip(row) {
                    *entry += own * other;
                }
            }
        }
        let [x1, x2, x3] = solve_symmetric(normal, right)?;
        let [s1, s2, s3] = belief.deviation;
        let step = [x1 * s1, x2 * s2, x3 * s3];
        all_finite(step).then_some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_posture_goes_by_the_name_nearer_to_what_is_expected() {
        for turns in -8_i32..=8 {
            let rotation = 0.1 + 0.35 * f64::from(turns);
            let state = [0.03, rotation, 0.9];
            let expected = [0.0, 0.2, 1.0];
            let [insertion, named, bending] = turn(state, half_turn(expected, state));
            assert!((named - 0.2).abs() <= FRAC_PI_2 + 1e-12, "{rotation}");
            let turns = (named - rotation) / PI;
            assert!((turns - turns.round()).abs() < 1e-12 && turns.abs() < 1.5);
            let side = if turns.abs() > 0.5 { -0.9 } else { 0.9 };
            assert!((insertion - 0.03).abs() + (bending - side).abs() < 1e-12);
        }
    }
}
