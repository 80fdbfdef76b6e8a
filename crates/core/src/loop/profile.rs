//! The interface of the profiles `paper` and `best`.

use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::history::Entry;
use crate::estimation::whereabouts::Whereabouts;
use crate::r#loop::axis::Axis;
use crate::r#loop::measurement::Measurement;
use crate::r#loop::settings::Settings;
use crate::model::features::FeatureModel;
use crate::supervision::flags::Flags;

/// A profile of the loop, `Paper` or `Best`.
#[expect(private_bounds, reason = "only this crate implements profiles")]
pub trait Profile: ProfileBlocks {}

impl<P: ProfileBlocks> Profile for P {}

/// Compensation laws and offset estimates of the three DOFs, and the state estimation.
pub(crate) trait ProfileBlocks: Sized {
    /// One DOF.
    type Axis: Axis;

    /// Flags that the profile's state estimate raises in normal operation, and that are therefore not checked.
    const UNCHECKED: Flags;

    /// A profile at rest.
    ///
    /// # Errors
    /// A setting is out of range.
    fn new(settings: &Settings) -> Result<Self, ConfigError>;

    /// The state prediction before the first image.
    ///
    /// # Errors
    /// A setting is out of range.
    fn whereabouts(settings: &Settings) -> Result<Whereabouts, ConfigError>;

    /// The three DOFs.
    fn axes(&self) -> &PerDof<Self::Axis>;

    /// The three DOFs, mutable.
    fn axes_mut(&mut self) -> &mut PerDof<Self::Axis>;

    /// Updates the friction that the DOFs share, after a control tick; returns whether they share any.
    fn couple(&mut self, reference: PerDof<f64>) -> bool;

    /// The state estimate from features (4,) in px and their covariance (4, 4) in px^2; None where a band is not
    /// visible.
    fn measure(
        &self,
        model: &FeatureModel,
        whereabouts: &Whereabouts,
        past: &Entry,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Option<Measurement>;

    /// Updates the state prediction with a measurement.
    fn update_prediction(
        &self,
        whereabouts: &mut Whereabouts,
        past: &Entry,
        measurement: &Measurement,
        measured: [f64; 4],
    );
}
