//! Parameters of one DOF of profile `best`.

use crate::adaptive::contact::ContactTest;
use crate::adaptive::lead::LeadLaw;
use crate::adaptive::offset_map::OffsetPrior;
use crate::adaptive::withheld::ChangeLimit;
use crate::error::{ConfigError, require, require_non_negative, require_positive};

/// Parameters of an [`AdaptiveAxis`](crate::AdaptiveAxis); lengths in the unit of the DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisParameters {
    /// The lead law.
    pub law: LeadLaw,
    /// `contact_gain` of a stroke that began with an offset uncertain by more than
    /// `cautious_deviation`.
    pub cautious_gain: f64,
    /// See `cautious_gain`. The free zone ends std^2 / `cautious_deviation` before the contact, with the standard
    /// deviation (std) of the offset.
    pub cautious_deviation: f64,
    /// The prior of the offsets.
    pub prior: OffsetPrior,
    /// The rate limit of the offsets.
    pub change: ChangeLimit,
    /// The test whether tip and command move together.
    pub contact: ContactTest,
    /// Standard deviation of a measured offset beyond that of the output.
    pub model_deviation: f64,
    /// Share of the measured correction of the predicted state that is applied, 0 to 1.
    pub correction: f64,
    /// Upper bound of every gain.
    pub gain_limit: f64,
    /// Time constant of the low-pass filter of the operator input that separates tremor from motion, in s.
    pub tremor_time: f64,
    /// Control period, in s.
    pub period: f64,
}

impl AxisParameters {
    pub(super) fn checked(self) -> Result<Self, ConfigError> {
        let law = self.law.checked()?;
        self.prior.checked()?;
        self.change.checked()?;
        let limit = self.gain_limit.is_finite() && self.gain_limit >= law.free_gain;
        require(
            limit,
            "gain_limit",
            self.gain_limit,
            "finite, at least free_gain",
        )?;
        let cautious = (1.0..=law.contact_gain).contains(&self.cautious_gain);
        require(
            cautious,
            "cautious_gain",
            self.cautious_gain,
            "at least 1, at most contact_gain",
        )?;
        require_positive("cautious_deviation", self.cautious_deviation)?;
        require_positive("contact_distance", self.contact.distance)?;
        require_non_negative("contact_moved", self.contact.moved)?;
        require_positive("slope_tolerance", self.contact.tolerance)?;
        require_positive("model_deviation", self.model_deviation)?;
        let share = (0.0..=1.0).contains(&self.correction);
        require(
            share,
            "state_correction",
            self.correction,
            "at least 0, at most 1",
        )?;
        require_non_negative("tremor_time", self.tremor_time)?;
        require_positive("period", self.period)?;
        Ok(self)
    }
}
