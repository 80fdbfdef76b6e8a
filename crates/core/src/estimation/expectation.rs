//! Where the bands should be and how they look, before an image is looked at and while it is.

use crate::dof::PerDof;
use crate::estimation::posture::{Belief, Observation};
use crate::math::linear::square;
use crate::math::whitening::{add_matrix, diagonal};
use crate::model::features::FeatureModel;
use crate::model::geometry_error::GeometryDeviation;
use crate::model::outline::BandImage;

/// States from which the best is sought.
const STARTS: usize = 3;

/// What is believed of the instrument's state: one of several, equally likely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beliefs<'a> {
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
    /// Where the belief has the bands' centroids, `[u_A, v_A, u_B, v_B]` (px).
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
    /// What to expect of an image in which features (4,) in px were seen with standard deviations (4,) in px:
    ///
    /// ```text
    /// q = the likeliest posture by `nearest_state`, over the believed states q0
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
        beliefs: &Beliefs<'_>,
        seen: [f64; 4],
        deviation: [f64; 4],
    ) -> Option<Expected> {
        let (believed, posture) = self.likeliest(beliefs, seen, deviation)?;
        let prediction = self.predict(posture)?;
        let bands = self.bands(posture)?;
        let [[ua, va], [ub, vb]] = bands.map(|band| band.centroid);
        let mut features = [ua, va, ub, vb];
        let (mut covariance, model, bands) = if beliefs.geometry == GeometryDeviation::EXACT {
            ([[0.0; 4]; 4], *self, bands)
        } else {
            let errors = self.geometry_errors(posture, &beliefs.geometry)?;
            let observed = Observation::and_error(seen, deviation, errors.covariance())?;
            let innovation = observed.innovation(&prediction);
            let model = errors.explain(self, observed.whitener(), innovation);
            (errors.covariance(), model, model.bands(posture)?)
        };
        let own = diagonal([square(beliefs.model_deviation); 4]);
        add_matrix(&mut covariance, &own);
        let dofs = believed.iter().zip(posture).zip(beliefs.deviation);
        for (column, ((believed, here), spread)) in prediction.columns.iter().zip(dofs) {
            for ((feature, row), by) in features.iter_mut().zip(&mut covariance).zip(column) {
                *feature += by * (believed - here);
                for (entry, other) in row.iter_mut().zip(column) {
                    *entry += by * other * square(spread);
                }
            }
        }
        Some(Expected {
            features,
            covariance,
            state: posture,
            bands,
            model,
        })
    }

    /// A believed state, and the posture to which it leads.
    fn likeliest(
        &self,
        beliefs: &Beliefs<'_>,
        seen: [f64; 4],
        deviation: [f64; 4],
    ) -> Option<(PerDof<f64>, PerDof<f64>)> {
        let belief = |state| Belief {
            state,
            deviation: beliefs.deviation,
        };
        let observed = |state| {
            if beliefs.geometry == GeometryDeviation::EXACT {
                return Some(Observation::new(seen, deviation));
            }
            let errors = self.geometry_errors(state, &beliefs.geometry)?;
            Observation::and_error(seen, deviation, errors.covariance())
        };
        // The states that explain the features best as they are; one of them leads to the best of all.
        let mut starts: [Option<(f64, PerDof<f64>)>; STARTS] = [None; STARTS];
        let mut consider = |state: PerDof<f64>| {
            let misfit = observed(state).and_then(|seen| self.misfit(&belief(state), state, &seen));
            let mut moved = misfit.map(|misfit| (misfit, state));
            for place in &mut starts {
                if let Some((misfit, _)) = moved
                    && place.is_none_or(|(least, _)| misfit < least)
                {
                    core::mem::swap(place, &mut moved);
                }
            }
        };
        beliefs.states.iter().copied().for_each(&mut consider);
        if let [[q1, q2, q3]] = *beliefs.states
            && self.predict([q1, q2, q3]).is_none()
        {
            // No band can be seen from there; but it need not be exactly there.
            let [d1, d2, d3] = beliefs.deviation;
            for side in [-1.0, 1.0] {
                consider([q1 + side * d1, q2, q3]);
                consider([q1, q2 + side * d2, q3]);
                consider([q1, q2, q3 + side * d3]);
            }
        }
        let found = starts.iter().flatten().filter_map(|(_, state)| {
            let (nearest, misfit) = self.nearest_state(&belief(*state), &observed(*state)?)?;
            Some((*state, nearest, misfit))
        });
        let (believed, posture, _) = found.min_by(|a, b| a.2.total_cmp(&b.2))?;
        let anywhere = beliefs.states.len() > 1;
        Some((if anywhere { posture } else { believed }, posture))
    }
}
