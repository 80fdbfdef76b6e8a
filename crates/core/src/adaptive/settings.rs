//! Settings of the compensation of profile `best`.

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
    /// Largest speed of the tip over that of the reference in contact, until the compensation offset is reached.
    pub contact_gain: f64,
    /// `contact_gain` of a stroke that begins with an uncertain offset.
    pub cautious_gain: f64,
    /// Standard deviation (std) above which an offset is uncertain. The free zone ends std^2 / `cautious_deviation`
    /// before the contact.
    pub cautious_deviation: f64,
    /// Last part of the gap, over which `free_gain` falls to `contact_gain`.
    pub taper: f64,
    /// Missing compensation offset below which the gain in contact falls to 1; the std of the offset is added.
    pub settling: f64,
    /// Time constant of the low-pass filter of the operator input that separates tremor from motion, in s.
    pub tremor_time: f64,
    /// Distance of the 33 positions at which an offset is estimated.
    pub node_spacing: f64,
    /// Standard deviation of the initial error of an offset that is equal at all positions.
    pub level_deviation: f64,
    /// Standard deviation of the command's travel over the tip's in contact, about 1; 0 assumes that both are equal. 0.3
    /// finds gains from 0.5 to 1 of an instrument of unknown scale.
    pub gain_deviation: f64,
    /// Standard deviation of the variation of an offset with position.
    pub local_deviation: f64,
    /// Correlation length of that variation.
    pub correlation: f64,
    /// Standard deviation of the change of an offset over a command travel of 1.
    pub level_drift: f64,
    /// Standard deviation of the change of the command's travel over the tip's, over a command travel of 1.
    pub gain_drift: f64,
    /// Standard deviation of the change of the variation with position, over a command travel of 1.
    pub local_drift: f64,
    /// Minus the correlation of the two offsets: friction moves both contacts outwards equally.
    pub symmetry: f64,
    /// Rate limit of a known contact offset in the compensation, per second of motion, for each DOF. That of bending
    /// bounds nothing: where one of its cables takes over from the other, offsets change within a stroke faster than by
    /// any motion of the endoscope.
    pub change_rate: PerDof<f64>,
    /// Deadband of the rate limiter for noise and variation with position.
    pub change_spare: f64,
    /// Travel of the command in contact, per side, after which the offsets are known.
    pub known_travel: f64,
    /// Travel of the command over which the contact test compares it with the tip.
    pub contact_distance: f64,
    /// Travel of the tip in a stroke from which on contact is possible.
    pub contact_moved: f64,
    /// Largest difference of tip travel over command travel in contact from 1.
    pub slope_tolerance: f64,
    /// Standard deviation of a measured offset beyond the marker noise.
    pub model_deviation: f64,
    /// Share of the measured correction of the predicted state that is applied, 0 to 1.
    pub state_correction: f64,
    /// Whether insertion and rotation share the friction of a shaft that slides and turns in its channel: what slides
    /// along it turns freely. False assumes independent slacks.
    pub one_friction: bool,
    /// Travel of the shaft's surface over which the slip direction is averaged, in `update_distance` of insertion.
    pub friction_memory: f64,
    /// Standard deviation of a slack that the motion of the other DOF reduces to 0, in half its width.
    pub friction_deviation: f64,
}

impl AdaptiveSettings {
    /// The parameters of one DOF with its `change_rate`, in the unit of the DOF.
    pub(crate) fn parameters(
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
                // Standard deviation per square root of travel.
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

    /// The settings of the friction that insertion and rotation of a shaft of this diameter in m share, if they do.
    pub(crate) fn friction(
        &self,
        insertion: &DofSettings,
        diameter: f64,
    ) -> Option<FrictionSettings> {
        self.one_friction.then(|| FrictionSettings {
            arm: diameter / 2.0,
            memory: self.friction_memory * insertion.update_distance,
            deviation: self.friction_deviation,
        })
    }
}
