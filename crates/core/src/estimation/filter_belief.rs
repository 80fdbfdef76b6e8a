//! Means and covariances of the filter.

use crate::dof::PerDof;
use crate::estimation::ensemble::{lag, position};
use crate::estimation::filter::Filter;
use crate::estimation::history::{Entry, History};
use crate::estimation::nominal::Nominal;
use crate::estimation::posture::Belief;
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

    /// Error of the geometry, [`FeatureModel::with_geometry`], and its covariance.
    ///
    /// [`FeatureModel::with_geometry`]: crate::model::features::FeatureModel::with_geometry
    pub fn geometry(&self) -> ([f64; GEOMETRY], [[f64; GEOMETRY]; GEOMETRY]) {
        self.regression.geometry()
    }

    /// Standard deviation of the tip from that of the plays (3,) [m, rad, rad].
    pub(super) fn deviation(&self) -> PerDof<f64> {
        self.unit.map(|unit| self.settings.tip_deviation * unit)
    }
}
