//! What the profiles `paper` and `best` have in common.

use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::history::Entry;
use crate::estimation::whereabouts::Whereabouts;
use crate::r#loop::axis::Axis;
use crate::r#loop::measurement::Measurement;
use crate::r#loop::settings::Settings;
use crate::model::features::FeatureModel;
use crate::supervision::flags::Flags;

/// The laws of the three DOFs, and the state estimation that feeds them.
pub trait Profile: Sized {
    /// One DOF.
    type Axis: Axis;

    /// Flags that the profile's state estimate raises in normal operation, and that are therefore not checked.
    const UNCHECKED: Flags;

    /// A profile at rest.
    ///
    /// # Errors
    /// A setting is out of range.
    fn new(settings: &Settings) -> Result<Self, ConfigError>;

    /// The prediction of where the bands are, before the first image.
    ///
    /// # Errors
    /// A setting is out of range.
    fn whereabouts(settings: &Settings) -> Result<Whereabouts, ConfigError>;

    /// The three DOFs.
    fn axes(&self) -> &PerDof<Self::Axis>;

    /// The three DOFs, to step and to update.
    fn axes_mut(&mut self) -> &mut PerDof<Self::Axis>;

    /// Pass the friction that the DOFs share between them, after a control tick; whether they share any.
    fn couple(&mut self, reference: PerDof<f64>) -> bool;

    /// The state estimate from features (4,) in px and their covariance (4, 4) in px^2; None where the model sees no
    /// band.
    fn measure(
        &self,
        model: &FeatureModel,
        whereabouts: &Whereabouts,
        past: &Entry,
        measured: [f64; 4],
        covariance: Option<&[[f64; 4]; 4]>,
    ) -> Option<Measurement>;

    /// Update the prediction of where the bands are.
    fn settle(
        &self,
        whereabouts: &mut Whereabouts,
        past: &Entry,
        measurement: &Measurement,
        measured: [f64; 4],
    );
}
