//! The interface of the profiles.

use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::article::state::StateEstimate;
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::expectation::StatePrior;
use crate::estimation::history::{Entry, History};
use crate::r#loop::measurement::Measurement;
use crate::r#loop::report::{GeometryEstimate, SlackEstimate};
use crate::r#loop::settings::LoopSettings;
use crate::model::features::FeatureModel;
use crate::supervision::flags::Flags;
use crate::supervision::monitors::Law;

/// An image: features (4,) in px with two NaN for a band that was not found, and their covariance (4, 4) in px^2, if known.
#[derive(Debug, Clone, Copy)]
pub struct Image<'a> {
    pub features: [f64; 4],
    pub covariance: Option<&'a [[f64; 4]; 4]>,
}

impl Image<'_> {
    /// The image with its two markers exchanged.
    pub fn exchanged(self) -> Self {
        let [ua, va, ub, vb] = self.features;
        Self {
            features: [ub, vb, ua, va],
            ..self
        }
    }
}

/// Result of an update with a measurement: which offsets were updated and why, and what was conspicuous.
pub type Updated<const N: usize> = ([Triggers; N], Flags);

/// A profile of the loop with N DOFs, `Paper` or `Best`: compensation law, offset estimates and state estimation. Only this crate
/// has profiles.
pub trait Profile<const N: usize = 3>: Law<N> + Sized {
    /// What an update needs of a measurement beside state and distance.
    type Evidence: Copy;

    /// Whether the DOFs that share a friction are bounded together.
    const IS_COUPLED: bool;

    /// The predicted state q (N,) [m or rad]; NaN before the first reference.
    fn predicted_state(&self) -> [f64; N];

    /// The sum of the changes of q by measurements so far (N,) [m or rad].
    fn corrected(&self) -> [f64; N] {
        [0.0; N]
    }

    /// The estimated play of each DOF.
    fn play(&self) -> [Play; N];

    /// The estimated slack of each DOF.
    fn slack_estimate(&self) -> SlackEstimate<N> {
        let play = self.play();
        SlackEstimate {
            half_width: play.map(|play| play.width() / 2.0),
            width_std: [f64::NAN; N],
            centre: play.map(|play| f64::midpoint(play.delta_minus(), play.delta_plus())),
            gain: [1.0; N],
            gain_std: [f64::NAN; N],
        }
    }

    /// Keeps up with the history at the end of a control tick.
    fn keep_up<S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>>(
        &mut self,
        _history: &History<S, N>,
        _has_clock_gone_back: bool,
    ) {
    }

    /// Propagates the state prediction to the time of a measurement.
    fn advance<S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>>(
        &mut self,
        _history: &History<S, N>,
        _past: &Entry<N>,
    ) {
    }

    /// Updates the state prediction with an accepted measurement, and with `updates_offsets` the offsets.
    fn update(
        &mut self,
        past: &Entry<N>,
        measurement: &Measurement<N, Self::Evidence>,
        updates_offsets: bool,
    ) -> Updated<N>;

    /// Makes the state prediction less certain after an image without markers.
    fn miss(&mut self, past: &Entry<N>);

    /// Makes the state prediction as uncertain as at the start.
    fn reset_prediction(&mut self, past: &Entry<N>);
}

/// A state estimate from the bands of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandsView {
    /// `q_hat`, innovation and which DOFs are observable.
    pub estimate: StateEstimate,
    /// Which markers were used.
    pub used: [bool; 2],
    /// h in px of the state the estimate started from.
    pub predicted_features: [f64; 4],
    /// Standard deviation of each DOF of `q_hat` [m, rad, rad].
    pub state_deviation: PerDof<f64>,
}

/// A measurement of a profile, and what the image showed.
pub type Seen<E> = (Measurement<3, E>, BandsView);

/// A profile of the article's instrument, which a camera sees by two bands.
pub trait BandProfile: Profile {
    /// A profile at rest.
    ///
    /// # Errors
    /// A setting is out of range.
    fn new(settings: &LoopSettings<3>, limits: PerDof<PlayLimit>) -> Result<Self, ConfigError>;

    /// The state prediction at a tick of the history.
    fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
        past: &Entry,
    ) -> StatePrior;

    /// The state estimate from an image of that time; None where a band is not visible.
    fn measure(
        &self,
        model: &FeatureModel,
        past: &Entry,
        image: Image<'_>,
    ) -> Option<Seen<Self::Evidence>>;

    /// What images say of the geometry, if it is estimated.
    fn geometry(&self) -> Option<GeometryEstimate> {
        None
    }

    /// The feature model as far as images have corrected the configured one.
    fn feature_model(&self, configured: &FeatureModel) -> FeatureModel {
        self.geometry().map_or(*configured, |found| {
            configured.with_geometry(found.errors())
        })
    }
}
