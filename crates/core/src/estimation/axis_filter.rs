//! The estimate of profile `best` for one DOF whose tip is measured directly.

use nalgebra::{SMatrix, SVector};

use crate::article::play::Play;
use crate::dof::Friction;
use crate::error::{ConfigError, require_positive};
use crate::estimation::estimate::Estimate;
use crate::estimation::estimate_settings::EstimateSettings;
use crate::estimation::measurement::Linear;
use crate::model::plays::{COEFFICIENTS, Plays, Transmission};
use crate::model::slack::Slack;

/// Filter of one DOF with measurements of its tip, for records of other instruments.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisFilter {
    estimate: Estimate<1, 0, COEFFICIENTS>,
    plays: Plays<1>,
    std: f64,
}

impl AxisFilter {
    /// The filter before the first command, for an expected width of the slack and a measured tip of standard deviation
    /// `std`; both in the unit of the command.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        settings: EstimateSettings,
        expected_width: f64,
        std: f64,
    ) -> Result<Self, ConfigError> {
        require_positive("std", std)?;
        require_positive("expected_width", expected_width)?;
        let unit = 0.75 * expected_width;
        let transmission = Transmission::new(Friction::independent(), [unit])?;
        let estimate = Estimate::new(settings, transmission, [], &[Slack::default()], [unit])?;
        Ok(Self {
            estimate,
            plays: Plays::REST,
            std,
        })
    }

    /// The predicted tip for the next command; one that is not finite moves nothing.
    pub fn step(&mut self, command: f64) -> f64 {
        if !command.is_finite() {
            let [tip] = self.estimate.tip(&self.plays);
            return tip;
        }
        if self.estimate.origin[0].is_nan() {
            self.estimate.origin = [command];
        }
        let [origin] = self.estimate.origin;
        let transmission = &self.estimate.transmission;
        let [unit] = transmission.unit();
        transmission.advance(&mut self.plays, &[(command - origin) / unit]);
        let [tip] = self.estimate.tip(&self.plays);
        tip
    }

    /// Updates the estimate with the tip measured at the last command; one that is not finite updates nothing.
    pub fn update(&mut self, tip: f64) {
        if !tip.is_finite() || self.estimate.origin[0].is_nan() {
            return;
        }
        self.estimate.advance(self.plays.travel);
        let [own] = self.estimate.noise();
        let std = libm::sqrt(self.std * self.std + own * own);
        let measurement = Linear {
            by_state: SMatrix::from([[1.0 / std]]),
            by_geometry: SMatrix::zeros(),
            value: SVector::from([tip / std]),
        };
        self.estimate.update(&self.plays, &measurement, 0.0, false);
    }

    /// The estimated play.
    pub fn play(&self) -> Play {
        let [slack] = self.estimate.slack();
        let [minus, plus] = slack.offsets();
        Play::from_ordered(minus, plus)
    }

    /// Travel of the tip over that of the command in contact.
    pub fn gain(&self) -> f64 {
        let [slack] = self.estimate.slack();
        slack.gain
    }
}
