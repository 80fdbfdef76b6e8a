//! The interface of the profiles.

use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::history::{Entry, History};
use crate::estimation::posture::Belief;
use crate::r#loop::measurement::Measurement;
use crate::r#loop::settings::Settings;
use crate::model::features::FeatureModel;
use crate::supervision::flags::Flags;
use crate::supervision::monitors::Law;

/// A profile of the loop: `Paper` or `Best`.
#[expect(private_bounds, reason = "only this crate implements profiles")]
pub trait Profile: ProfileBlocks {}

impl<P: ProfileBlocks> Profile for P {}

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

/// Result of an update with an image.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImageUpdate {
    /// Which offsets were updated, and why.
    pub triggers: PerDof<Triggers>,
    /// What was conspicuous.
    pub raised: Flags,
}

/// Compensation law, offset estimates and state estimation.
pub(crate) trait ProfileBlocks: Law<3> + Sized {
    /// Whether the DOFs that share a friction are bounded together.
    const IS_COUPLED: bool;

    /// A profile at rest.
    ///
    /// # Errors
    /// A setting is out of range.
    fn new(settings: &Settings, limits: PerDof<PlayLimit>) -> Result<Self, ConfigError>;

    /// The predicted state q (3,) [m, rad, rad]; NaN before the first reference.
    fn predicted_state(&self) -> PerDof<f64>;

    /// The sum of the changes of q by images so far (3,) [m, rad, rad].
    fn corrected(&self) -> PerDof<f64> {
        [0.0; 3]
    }

    /// The estimated play of each DOF.
    fn play(&self) -> PerDof<Play>;

    /// Keeps up with the history at the end of a control tick.
    fn keep_up<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &mut self,
        history: &History<S>,
        has_clock_gone_back: bool,
    );

    /// The state prediction at a tick of the history.
    fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
        past: &Entry,
    ) -> Belief;

    /// Propagates the state prediction to the time of an image.
    fn advance<S: AsRef<[Entry]> + AsMut<[Entry]>>(&mut self, history: &History<S>, past: &Entry);

    /// The state estimate from an image of that time; None where a band is not visible.
    fn measure(&self, model: &FeatureModel, past: &Entry, image: Image<'_>) -> Option<Measurement>;

    /// Updates the state prediction with an accepted image, and with `updates_offsets` the offsets.
    fn update(
        &mut self,
        past: &Entry,
        measurement: &Measurement,
        updates_offsets: bool,
    ) -> ImageUpdate;

    /// The feature model as far as images have corrected the configured one.
    fn feature_model(&self, configured: &FeatureModel) -> FeatureModel {
        *configured
    }

    /// The state in which the configured feature model has the bands where the corrected one has them in the state of a
    /// belief; where that finds none, the belief.
    fn apparent(&self, configured: &FeatureModel, belief: Belief) -> Belief {
        let _ = configured;
        belief
    }

    /// Makes the state prediction less certain after an image without markers.
    fn miss(&mut self, past: &Entry);

    /// Makes the state prediction as uncertain as at the start.
    fn reset_prediction(&mut self, past: &Entry);
}
