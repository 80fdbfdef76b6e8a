//! All settings of the loop, a table per block.

use crate::dof::Friction;
use crate::error::ConfigError;
use crate::estimation::estimate_settings::EstimateSettings;
use crate::estimation::history::history_entries;
use crate::law::settings::LawSettings;
use crate::model::features::FeatureModel;
use crate::model::plays::Transmission;
use crate::model::settings::{CameraSettings, InstrumentSettings};
use crate::settings::{ControlSettings, DofSettings};
use crate::supervision::settings::SafetySettings;

/// Settings of a loop: the sections of the TOML configuration that the core reads, by their names.
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
    pub law: LawSettings,
    /// Estimation of profile `best`.
    pub estimation: EstimateSettings,
}

/// Settings of a loop with N DOFs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopSettings<const N: usize> {
    /// The DOFs in the order of every array.
    pub dofs: [DofSettings; N],
    /// Which DOFs share a friction.
    pub friction: Friction<N>,
    /// The loop's clock.
    pub control: ControlSettings,
    /// Supervision.
    pub safety: SafetySettings<N>,
    /// Compensation of profile `best`.
    pub law: LawSettings,
    /// Estimation of profile `best`.
    pub estimation: EstimateSettings,
}

impl<const N: usize> LoopSettings<N> {
    /// The plays of profile `best`.
    ///
    /// # Errors
    /// An expected width is not a finite number above 0.
    pub(crate) fn transmission(&self) -> Result<Transmission<N>, ConfigError> {
        Transmission::new(
            self.friction,
            self.dofs.map(|dof| 0.75 * dof.expected_width),
        )
    }
}

impl Settings {
    /// What does not depend on the instrument.
    ///
    /// # Errors
    /// The diameter is not a finite number above 0.
    pub(crate) fn of_loop(&self) -> Result<LoopSettings<3>, ConfigError> {
        Ok(LoopSettings {
            dofs: [self.insertion, self.rotation, self.bending],
            // Insertion and rotation share the friction of the shaft, whose surface a rotation moves by the radius.
            friction: Friction::new([0, 0, 2], [1.0, self.instrument.diameter / 2.0, 1.0])?,
            control: self.control,
            safety: self.safety,
            law: self.law,
            estimation: self.estimation,
        })
    }

    /// Entries of the history that a loop with these settings needs.
    pub fn history_entries(&self) -> usize {
        history_entries(self.control.history, self.control.period)
    }

    /// The model that predicts features, Eqs. (9)-(11).
    ///
    /// # Errors
    /// A length, a focal length or the pose is out of range.
    pub fn feature_model(&self) -> Result<FeatureModel, ConfigError> {
        FeatureModel::from_settings(&self.instrument, &self.camera)
    }
}
