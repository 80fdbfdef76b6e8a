//! Settings of profile `best`, as the configuration has them.

use crate::adaptive::contact::ContactTest;
use crate::adaptive::friction::FrictionSettings;
use crate::adaptive::lead::LeadLaw;
use crate::adaptive::offset_map::OffsetPrior;
use crate::adaptive::parameters::AxisParameters;
use crate::adaptive::withheld::ChangeLimit;
use crate::dof::PerDof;
use crate::settings::{ControlSettings, DofSettings};

/// Compensation of profile `best`. Names are those of the TOML keys; lengths are in `update_distance` of the DOF, so
/// that one set serves all three.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct AdaptiveSettings {
    /// See `LeadLaw::contact_gain`.
    pub contact_gain: f64,
    /// See `AxisParameters::cautious_gain`.
    pub cautious_gain: f64,
    /// See `AxisParameters::cautious_deviation`.
    pub cautious_deviation: f64,
    /// See `LeadLaw::taper`.
    pub taper: f64,
    /// See `LeadLaw::settling`.
    pub settling: f64,
    /// See `AxisParameters::tremor_time`.
    pub tremor_time: f64,
    /// See `OffsetPrior::spacing`.
    pub node_spacing: f64,
    /// See `OffsetPrior::level`.
    pub level_deviation: f64,
    /// See `OffsetPrior::tilt`.
    pub gain_deviation: f64,
    /// See `OffsetPrior::local`.
    pub local_deviation: f64,
    /// See `OffsetPrior::correlation`.
    pub correlation: f64,
    /// See `OffsetPrior::level_drift`.
    pub level_drift: f64,
    /// See `OffsetPrior::tilt_drift`.
    pub gain_drift: f64,
    /// See `OffsetPrior::local_drift`.
    pub local_drift: f64,
    /// See `OffsetPrior::symmetry`.
    pub symmetry: f64,
    /// See `ChangeLimit::rate`.
    pub change_rate: PerDof<f64>,
    /// See `ChangeLimit::spare`.
    pub change_spare: f64,
    /// See `ChangeLimit::known`.
    pub known_travel: f64,
    /// See `ContactTest::distance`.
    pub contact_distance: f64,
    /// See `ContactTest::moved`.
    pub contact_moved: f64,
    /// See `ContactTest::tolerance`.
    pub slope_tolerance: f64,
    /// See `AxisParameters::model_deviation`.
    pub model_deviation: f64,
    /// See `AxisParameters::correction`.
    pub state_correction: f64,
    /// Whether insertion and rotation share the friction of the shaft.
    pub one_friction: bool,
    /// See `FrictionSettings::memory`; in `update_distance` of insertion.
    pub friction_memory: f64,
    /// See `FrictionSettings::deviation`.
    pub friction_deviation: f64,
}

impl AdaptiveSettings {
    /// The parameters of one DOF, in its unit. `change_rate` is that DOF's.
    pub fn parameters(
        &self,
        dof: &DofSettings,
        change_rate: f64,
        control: &ControlSettings,
    ) -> AxisParameters {
        let unit = dof.update_distance;
        let contact_gain = self.contact_gain.min(dof.free_gain);
        AxisParameters {
            law: LeadLaw {
                free_gain: dof.free_gain,
                contact_gain,
                taper: unit * self.taper,
                settling: unit * self.settling,
            },
            cautious_gain: self.cautious_gain.min(contact_gain),
            cautious_deviation: unit * self.cautious_deviation,
            prior: OffsetPrior {
                spacing: unit * self.node_spacing,
                level: unit * self.level_deviation,
                tilt: self.gain_deviation,
                local: unit * self.local_deviation,
                correlation: unit * self.correlation,
                // A deviation per square root of travel.
                level_drift: libm::sqrt(unit) * self.level_drift,
                tilt_drift: self.gain_drift / libm::sqrt(unit),
                local_drift: libm::sqrt(unit) * self.local_drift,
                symmetry: self.symmetry,
            },
            change: ChangeLimit {
                rate: unit * change_rate,
                spare: unit * self.change_spare,
                known: unit * self.known_travel,
            },
            contact: ContactTest {
                distance: unit * self.contact_distance,
                moved: unit * self.contact_moved,
                tolerance: self.slope_tolerance,
            },
            model_deviation: unit * self.model_deviation,
            correction: self.state_correction,
            gain_limit: dof.gain_limit,
            tremor_time: self.tremor_time,
            period: control.period,
        }
    }

    /// The friction that insertion and rotation of a shaft of this diameter in m share, if they do.
    pub fn friction(&self, insertion: &DofSettings, diameter: f64) -> Option<FrictionSettings> {
        self.one_friction.then(|| FrictionSettings {
            arm: diameter / 2.0,
            memory: self.friction_memory * insertion.update_distance,
            deviation: self.friction_deviation,
        })
    }
}
