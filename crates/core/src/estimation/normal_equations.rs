//! The least squares of [`crate::WeightedEstimator`], linear about one state.

use crate::dof::PerDof;
use crate::estimation::posture::Belief;
use crate::estimation::sight::{Sight, Sights};
use crate::math::linear::{Matrix, add, diagonal_of_inverse, dot, scale, solve_symmetric, times};
use crate::model::features::FeatureModel;

const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The Gauss-Newton step x from a state q, in the belief's deviations, by
///
/// ```text
/// x = (q_next - q) / deviation
/// (N + I) x = r - away        away = (q - belief) / deviation
/// N = J' J - c c' / n         J  columns of h at q, times deviation, whitened
/// r = J' e - c p / n          e  misfit s - h(q), whitened
/// cost = away' away + e' e - p^2 / n
/// n = 1 + g' g,  c = J' g,  p = g' e
/// ```
///
/// with g what a displacement across the bend by its standard deviation does to the features,
/// whitened: the displacement itself is eliminated. I and away are the belief; N and r are the image alone.
#[derive(Clone, Copy)]
pub struct NormalEquations {
    normal: Matrix,
    right: PerDof<f64>,
    away: PerDof<f64>,
    /// What is minimised, at q.
    pub cost: f64,
}

impl NormalEquations {
    /// About a state, for the markers seen; `sideways_deviation` is of the displacement in m.
    ///
    /// None where the model sees no band, or the cost is not finite.
    pub fn about(
        state: PerDof<f64>,
        model: &FeatureModel,
        belief: &Belief,
        sights: Sights,
        sideways_deviation: f64,
    ) -> Option<Self> {
        let prediction = model.predict(state)?;
        let sideways = scaled(sideways_deviation, model.sideways(state)?);
        let [q1, q2, q3] = state;
        let [b1, b2, b3] = belief.state;
        let [d1, d2, d3] = belief.deviation;
        let away = [(q1 - b1) / d1, (q2 - b2) / d2, (q3 - b3) / d3];
        let [c1, c2, c3] = prediction.columns;
        let [c1, c2, c3] = [scaled(d1, c1), scaled(d2, c2), scaled(d3, c3)];

        let mut normal = [[0.0; 3]; 3];
        let mut right = [0.0; 3];
        let mut cost = dot(away, away);
        // Of the displacement: its own normal entry, those with q, and its right side.
        let (mut own, mut with, mut pull) = (1.0, [0.0; 3], 0.0);
        let halves = |[a0, a1, b0, b1]: [f64; 4]| [[a0, a1], [b0, b1]];
        let [features, c1, c2, c3, sideways] =
            [prediction.features, c1, c2, c3, sideways].map(halves);
        let columns = c1.iter().zip(c2).zip(c3).zip(sideways);
        for ((sight, predicted), (((c1, c2), c3), g)) in sights.iter().zip(features).zip(columns) {
            let Some(Sight { place, whitener }) = sight else {
                continue;
            };
            let ([u, v], [pu, pv]) = (*place, predicted);
            for [first, second] in *whitener {
                let white = |[u, v]: [f64; 2]| first * u + second * v;
                let row = [white(*c1), white(c2), white(c3)];
                let (misfit, g) = (white([u - pu, v - pv]), white(g));
                for (line, entry) in normal.iter_mut().zip(row) {
                    *line = add(*line, entry, row);
                }
                right = add(right, misfit, row);
                with = add(with, g, row);
                own += g * g;
                pull += g * misfit;
                cost += misfit * misfit;
            }
        }
        for (line, entry) in normal.iter_mut().zip(with) {
            *line = add(*line, -entry / own, with);
        }
        let cost = cost - pull * pull / own;
        cost.is_finite().then_some(Self {
            normal,
            right: add(right, -pull / own, with),
            away,
            cost,
        })
    }

    /// N + I.
    pub fn whole(&self) -> Matrix {
        let mut whole = self.normal;
        for (line, unit) in whole.iter_mut().zip(IDENTITY) {
            *line = add(*line, 1.0, unit);
        }
        whole
    }

    /// x; None where it is not determined.
    pub fn step(&self) -> Option<PerDof<f64>> {
        solve_symmetric(self.whole(), add(self.right, -1.0, self.away))
    }

    /// State and deviation from the image alone, the DOFs it does not determine left where they are.
    pub fn image_alone(
        &self,
        belief: &Belief,
        state: PerDof<f64>,
        observable: PerDof<bool>,
    ) -> (PerDof<f64>, PerDof<f64>) {
        let mask = observable.map(|seen| if seen { 1.0 } else { 0.0 });
        let mut normal = self.normal;
        for ((line, unit), own) in normal.iter_mut().zip(IDENTITY).zip(mask) {
            *line = add(scale(own, times(*line, mask)), 1.0 - own, unit);
        }
        let solved = solve_symmetric(normal, times(self.right, mask));
        let (Some(step), Some(variance)) = (solved, diagonal_of_inverse(normal)) else {
            return ([f64::NAN; 3], [f64::NAN; 3]);
        };
        let seen = observable.map(|seen| if seen { 1.0 } else { f64::NAN });
        let moved = add(state, 1.0, times(step, belief.deviation));
        let deviation = times(variance.map(libm::sqrt), belief.deviation);
        (times(moved, seen), times(deviation, seen))
    }
}

fn scaled(factor: f64, column: [f64; 4]) -> [f64; 4] {
    column.map(|value| factor * value)
}
