//! The state estimate of profile `best`: weighted, iterated, and not led astray by a wrong marker.

use crate::article::state::{StateEstimate, StateEstimator};
use crate::dof::PerDof;
use crate::error::{ConfigError, require, require_non_negative, require_positive};
use crate::estimation::normal_equations::NormalEquations;
use crate::estimation::posture::Belief;
use crate::estimation::settings::StateEstimationSettings;
use crate::estimation::sight::{Sights, both, only, sights};
use crate::math::linear::{add, diagonal_of_inverse, dot, rotate, square, times};
use crate::model::features::FeatureModel;

/// A step goes no farther, in the belief's standard deviations: bent to the other side and turned by half a turn the
/// instrument looks the same, and a long step may end there.
const FARTHEST: f64 = 0.7;
/// A step is halved at most so often.
const HALVINGS: usize = 5;
/// Squared size of a step, in posterior standard deviations, below which there is no other.
const SMALL: f64 = 1e-10;
/// Where else to start, from the belief in its standard deviations, while the cost is that of a wrong marker.
const STARTS: [PerDof<f64>; 6] = [
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
];

/// Share of its variance that an image leaves a DOF that it does not determine, from which the DOF is held.
const LEFT: f64 = 0.5;
/// Share that is left of the deviation of a DOF that is held.
const HELD: f64 = 1e-3;

/// The most probable state, given a belief and an image.
///
/// ```text
/// argmin over q, w and which markers m are used
///   sum_used |s_m - h_m(q) - g_m w|^2 / (C_m + model_deviation^2 I)
///   + sum_j ((q_j - belief_j) / deviation_j)^2 + (w / sideways_deviation)^2
///   + outlier_distance^2 for each marker that is not used
/// ```
///
/// h as in Eqs. (9)-(11), C (2, 2) each marker's own covariance, and g how its image moves when the tip is
/// displaced by w across the bend: two markers on a straight tip tell how far it turned,
/// but hardly where along the section. With two markers every choice is tried, if the first, both, costs more
/// than leaving one out, so the least is found and not a local one. By Gauss-Newton, each step halved while it
/// makes things worse.
///
/// Where two markers do not determine a DOF, and say less of it than the belief does, it is held there: close to straight, rotation follows what
/// noise and an uneven bend make of it, and comes out half a turn on and bent the other way.
///
/// With one step, equal covariances, a belief that knows nothing, no w and no outliers it is Eq. (16).
///
/// Wrong in another valley than the belief's, and where both markers are wrong alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedEstimator {
    watch: StateEstimator,
    settings: StateEstimationSettings,
}

/// What a belief and an image say together, and what the image says alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedEstimate {
    /// The most probable state, of all DOFs; which the image determined, as [`StateEstimator`] has
    /// it for the markers used; the innovation against the belief.
    pub estimate: StateEstimate,
    /// Standard deviation of the state [m, rad, rad].
    pub deviation: PerDof<f64>,
    /// The state without the belief [m, rad, rad]; NaN where the image does not determine it.
    pub image_state: PerDof<f64>,
    /// Standard deviation of that.
    pub image_deviation: PerDof<f64>,
    /// h(belief) in px.
    pub predicted_features: [f64; 4],
    /// Which markers were used.
    pub used: [bool; 2],
}

impl WeightedEstimator {
    /// An estimator that watches the rank by `watch`.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        watch: StateEstimator,
        settings: StateEstimationSettings,
    ) -> Result<Self, ConfigError> {
        require_positive("marker_deviation", settings.marker_deviation)?;
        require_non_negative("model_deviation", settings.model_deviation)?;
        require_non_negative("sideways_deviation", settings.sideways_deviation)?;
        let outlier = settings.outlier_distance;
        require(outlier > 0.0, "outlier_distance", outlier, "above 0")?;
        let steps = settings.steps;
        require(
            (1..=100).contains(&steps),
            "steps",
            f64::from(steps),
            "1 to 100",
        )?;
        Ok(Self { watch, settings })
    }

    /// The state estimate for features (4,) in px and their covariance (4, 4) in px^2, of which the
    /// part between two markers is not used; None is `marker_deviation` for each. Two NaN for a band say that it was not found.
    ///
    /// None where the model sees no band for the belief, or something else is not finite.
    pub fn estimate(
        &self,
        model: &FeatureModel,
        belief: &Belief,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Option<WeightedEstimate> {
        let sights = sights(
            measured,
            covariance,
            self.settings.marker_deviation,
            self.settings.model_deviation,
        );
        let (state, used) = self.most_probable(model, belief, sights)?;
        let [a, b] = used;
        let [ua, va, ub, vb] = measured;
        let shown = |used: bool, value: f64| if used { value } else { f64::NAN };
        let kept = [shown(a, ua), shown(a, va), shown(b, ub), shown(b, vb)];

        let kept_sights = only(used, sights);
        let watch = |state| Some(self.watch.estimate(state, &model.predict(state)?, kept));
        let (mut state, mut watched) = (state, watch(state)?);
        let mut free = [true; 3];
        if used == [true; 2] && watched.observable != free {
            let around = self.equations(model, belief, state, kept_sights)?;
            let left = diagonal_of_inverse(around.whole())?;
            for (free, (observable, left)) in
                free.iter_mut().zip(watched.observable.iter().zip(left))
            {
                *free = *observable || left < LEFT;
            }
        }
        if free != [true; 3] {
            let narrow = holding(belief, free);
            (state, _) = self.minimum(model, &narrow, narrow.state, kept_sights)?;
            watched = watch(state)?;
            for (observable, free) in watched.observable.iter_mut().zip(free) {
                *observable &= free;
            }
        }
        let equations = self.equations(model, belief, state, kept_sights)?;
        let variance = diagonal_of_inverse(equations.whole())?;
        let mut shares = variance.map(libm::sqrt);
        for (share, free) in shares.iter_mut().zip(free) {
            *share = if free { *share } else { 1.0 };
        }
        let (image_state, image_deviation) =
            equations.image_alone(belief, state, watched.observable);
        let start = model.predict(belief.state)?;
        let mut innovation = measured;
        for (value, predicted) in innovation.iter_mut().zip(start.features) {
            *value -= predicted;
        }
        Some(WeightedEstimate {
            estimate: StateEstimate {
                state,
                innovation,
                ..watched
            },
            deviation: times(shares, belief.deviation),
            image_state,
            image_deviation,
            predicted_features: start.features,
            used,
        })
    }

    /// The state, and which markers it rests on.
    fn most_probable(
        &self,
        model: &FeatureModel,
        belief: &Belief,
        sights: Sights,
    ) -> Option<(PerDof<f64>, [bool; 2])> {
        let seen = sights.map(|sight| sight.is_some());
        let price = square(self.settings.outlier_distance);
        let (mut state, mut cost) = self.minimum(model, belief, belief.state, sights)?;
        for start in STARTS {
            if cost <= price {
                break;
            }
            let start = add(belief.state, 1.0, times(start, belief.deviation));
            if let Some((other, less)) = self.minimum(model, belief, start, sights)
                && less < cost
            {
                (state, cost) = (other, less);
            }
        }
        let mut used = seen;
        let fewer = [[true, false], [false, true], [false, false]];
        for choice in fewer {
            let kept = both(seen, choice);
            let left_out = seen.iter().zip(kept).filter(|(seen, kept)| *seen != kept);
            let fine = left_out.fold(0.0, |sum, _| sum + price);
            // A choice that leaves nothing out is the first once more.
            if kept == seen || cost <= fine {
                continue;
            }
            if let Some((other, rest)) =
                self.minimum(model, belief, belief.state, only(kept, sights))
                && rest + fine < cost
            {
                (state, cost, used) = (other, rest + fine, kept);
            }
        }
        Some((state, used))
    }

    fn minimum(
        &self,
        model: &FeatureModel,
        belief: &Belief,
        start: PerDof<f64>,
        sights: Sights,
    ) -> Option<(PerDof<f64>, f64)> {
        let mut state = start;
        let mut here = self.equations(model, belief, state, sights)?;
        for _ in 0..self.settings.steps {
            let Some(step) = here.step() else { break };
            let size = dot(step, rotate(&here.whole(), step));
            let longest = step
                .iter()
                .fold(0.0, |most: f64, value| most.max(value.abs()));
            let mut share = 1.0_f64.min(FARTHEST / longest);
            let better = (0..HALVINGS).find_map(|_| {
                let trial = add(state, share, times(step, belief.deviation));
                share /= 2.0;
                let there = self.equations(model, belief, trial, sights)?;
                (there.cost <= here.cost).then_some((trial, there))
            });
            let Some((trial, there)) = better else { break };
            (state, here) = (trial, there);
            if size < SMALL {
                break;
            }
        }
        Some((state, here.cost))
    }

    fn equations(
        &self,
        model: &FeatureModel,
        belief: &Belief,
        state: PerDof<f64>,
        sights: Sights,
    ) -> Option<NormalEquations> {
        let sideways = self.settings.sideways_deviation;
        NormalEquations::about(state, model, belief, sights, sideways)
    }
}

/// The belief with no doubt about what is held.
fn holding(belief: &Belief, free: PerDof<bool>) -> Belief {
    let shares = free.map(|free| if free { 1.0 } else { HELD });
    Belief {
        deviation: times(shares, belief.deviation),
        ..*belief
    }
}
