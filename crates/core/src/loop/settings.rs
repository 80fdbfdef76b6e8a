//! All settings of the loop, a table per block.

use crate::adaptive::settings::AdaptiveSettings;
use crate::dof::PerDof;
use crate::error::ConfigError;
use crate::estimation::settings::StateEstimationSettings;
use crate::model::features::FeatureModel;
use crate::model::settings::{CameraSettings, InstrumentSettings};
use crate::settings::{ControlSettings, DofSettings};
use crate::supervision::settings::SafetySettings;

/// What a loop depends on: the sections of the TOML configuration that the core reads, by their names.
///
/// `python/tautscope/config` has every default with its origin.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct Settings {
    /// The first DOF, in m.
    pub insertion: DofSettings,
    /// The second DOF, in rad.
    pub rotation: DofSettings,
    /// The third DOF, in rad.
    pub bending: DofSettings,
    /// Geometry of the instrument.
    pub instrument: InstrumentSettings,
    /// Camera and its pose.
    pub camera: CameraSettings,
    /// The loop's clock.
    pub control: ControlSettings,
    /// Supervision.
    pub safety: SafetySettings,
    /// Compensation of profile `best`.
    pub adaptive: AdaptiveSettings,
    /// State estimation of profile `best`.
    pub state_estimation: StateEstimationSettings,
}

impl Settings {
    /// The three DOFs in their order.
    pub const fn dofs(&self) -> PerDof<DofSettings> {
        [self.insertion, self.rotation, self.bending]
    }

    /// Predicted features, Eqs. (9)-(11).
    ///
    /// # Errors
    /// A length, a focal length or the pose is out of range.
    pub fn feature_model(&self) -> Result<FeatureModel, ConfigError> {
        FeatureModel::from_settings(&self.instrument, &self.camera)
    }
}
