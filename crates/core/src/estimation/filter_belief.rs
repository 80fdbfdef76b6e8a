//! Means and covariances of the filter.

use crate::dof::PerDof;
use crate::estimation::ensemble::{State, geometry, lag, position};
use crate::estimation::filter::Filter;
use crate::estimation::history::{Entry, History};
use crate::estimation::nominal::Nominal;
use crate::estimation::posture::Belief;
use crate::math::linear::{dot, solve_symmetric};
use crate::model::features::GEOMETRY;

impl Filter {
    /// Mean and standard deviations of the tip at a tick of the history.
    pub fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
        to: &Entry,
    ) -> Belief {
        let mut ahead = self.clone();
        ahead.advance(history, to);
        ahead.belief()
    }

    /// Mean and standard deviations of the tip of the ensemble.
    pub fn belief(&self) -> Belief {
        let ([q1, q2, q3], [[v1, _, _], [_, v2, _], [_, _, v3]]) = self.tips();
        Belief {
            state: [q1, q2, q3],
            deviation: [v1, v2, v3].map(libm::sqrt),
        }
    }

    /// Mean and covariance of the tip, with its deviation from the plays, which is taken for noise.
    pub(super) fn tips(&self) -> ([f64; 3], [[f64; 3]; 3]) {
        let nominal = Nominal {
            velocity: self.velocity,
            residual: [0.0; 3],
            ..self.nominal
        };
        let (mean, [[v1, a, b], [c, v2, d], [e, f, v3]]) = self
            .ensemble
            .covariance(|state| nominal.lagging_tip(position(state).output, lag(state)));
        let [d1, d2, d3] = self.deviation();
        let covariance = [
            [v1 + d1 * d1, a, b],
            [c, v2 + d2 * d2, d],
            [e, f, v3 + d3 * d3],
        ];
        (mean, covariance)
    }

    /// Mean and covariance of the geometry.
    pub fn geometry(&self) -> ([f64; GEOMETRY], [[f64; GEOMETRY]; GEOMETRY]) {
        self.ensemble.covariance(geometry)
    }

    /// Mean of the geometry, and its covariance where the output of the plays is known: G - X' P^-1 X with the covariances G
    /// of the geometry, P of the output and X of both.
    pub(super) fn geometry_of_a_known_output(
        &self,
    ) -> ([f64; GEOMETRY], [[f64; GEOMETRY]; GEOMETRY]) {
        let joint = |state: &State| {
            let ([a, b, c], [d, e, f]) = (position(state).output, geometry(state));
            [a, b, c, d, e, f]
        };
        let ([_, _, _, d, e, f], [a1, a2, a3, d1, e1, f1]) = self.ensemble.covariance(joint);
        let split = |[x1, x2, x3, g1, g2, g3]: [f64; 6]| ([x1, x2, x3], [g1, g2, g3]);
        let outputs = [a1, a2, a3].map(|row| split(row).0);
        let (crosses, mut own) = (
            [d1, e1, f1].map(|row| split(row).0),
            [d1, e1, f1].map(|row| split(row).1),
        );
        for (row, cross) in own.iter_mut().zip(crosses) {
            let Some(solved) = solve_symmetric(outputs, cross) else {
                continue;
            };
            for (entry, other) in row.iter_mut().zip(crosses) {
                *entry -= dot(solved, other);
            }
        }
        ([d, e, f], own)
    }

    /// Standard deviation of the tip from that of the plays (3,) [m, rad, rad].
    pub(super) fn deviation(&self) -> PerDof<f64> {
        self.unit.map(|unit| self.settings.tip_deviation * unit)
    }
}
