//! From features back to the state: the posture that explains what is seen.

use core::f64::consts::{FRAC_PI_2, PI};

use crate::dof::{PerDof, all_finite};
use crate::math::linear::{solve_symmetric, square};
use crate::model::features::FeatureModel;

const STEPS: usize = 8;

/// What is believed of the state before an image is looked at: normal, each DOF by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief {
    /// Most probable state (3,) [m, rad, rad].
    pub state: PerDof<f64>,
    /// Standard deviations (3,) [m, rad, rad].
    pub deviation: PerDof<f64>,
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

impl FeatureModel {
    /// The most probable state, and what is minimised, for features (4,) in px measured with standard deviations (4,) in px:
    ///
    /// ```text
    /// argmin  sum_i ((h_i(q) - s_i) / deviation_i)^2 + sum_j ((q_j - belief_j) / deviation_j)^2
    /// ```
    ///
    /// by at most eight Gauss-Newton steps, each halved while it makes things worse. A feature of
    /// infinite deviation, or that is not finite, says nothing.
    ///
    /// It is for where and how large the bands should be; the loop's state estimate is Eq. (16), one step.
    /// None where the model sees no band. Wrong in another valley than the belief's.
    pub fn nearest_state(
        &self,
        belief: &Belief,
        measured: [f64; 4],
        deviation: [f64; 4],
    ) -> Option<(PerDof<f64>, f64)> {
        let mut state = belief.state;
        let mut cost = self.misfit(belief, state, measured, deviation)?;
        for _ in 0..STEPS {
            let step = self.gauss_newton(belief, state, measured, deviation)?;
            let mut share = 1.0;
            let better = loop {
                let mut trial = state;
                for (value, step) in trial.iter_mut().zip(step) {
                    *value += share * step;
                }
                match self.misfit(belief, trial, measured, deviation) {
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
        measured: [f64; 4],
        deviation: [f64; 4],
    ) -> Option<f64> {
        let features = self.predict(state)?.features;
        let seen = features.iter().zip(measured).zip(deviation);
        let misfit: f64 = seen
            .map(|((h, s), deviation)| {
                square(weight(s, deviation) * (h - if s.is_finite() { s } else { *h }))
            })
            .sum();
        let believed = state.iter().zip(belief.state).zip(belief.deviation);
        let cost = misfit
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
        measured: [f64; 4],
        deviation: [f64; 4],
    ) -> Option<PerDof<f64>> {
        let prediction = self.predict(state)?;
        let [s1, s2, s3] = belief.deviation;
        let mut normal = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut right = [0.0; 3];
        for (((right, q), q0), scale) in right
            .iter_mut()
            .zip(state)
            .zip(belief.state)
            .zip(belief.deviation)
        {
            *right = (q0 - q) / scale;
        }
        let [c1, c2, c3] = prediction.columns;
        let rows = c1.iter().zip(c2).zip(c3);
        let seen = prediction.features.iter().zip(measured).zip(deviation);
        for (((a, b), c), ((h, s), deviation)) in rows.zip(seen) {
            let weight = weight(s, deviation);
            if weight == 0.0 {
                continue;
            }
            let row = [a * s1, b * s2, c * s3].map(|value| value * weight);
            let misfit = weight * (s - h);
            for ((line, right), own) in normal.iter_mut().zip(&mut right).zip(row) {
                *right += own * misfit;
                for (entry, other) in line.iter_mut().zip(row) {
                    *entry += own * other;
                }
            }
        }
        let [x1, x2, x3] = solve_symmetric(normal, right)?;
        let step = [x1 * s1, x2 * s2, x3 * s3];
        all_finite(step).then_some(step)
    }
}

fn weight(measured: f64, deviation: f64) -> f64 {
    if measured.is_finite() {
        1.0 / deviation
    } else {
        0.0
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
