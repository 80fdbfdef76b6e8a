//! The estimate of profile `best` for one DOF whose tip is measured directly.

use crate::article::play::Play;
use crate::error::ConfigError;
use crate::estimation::filter::Filter;
use crate::estimation::marker_measurement::TipMeasurement;
use crate::estimation::settings::StateEstimationSettings;
use crate::model::features::GEOMETRY;

/// Ensemble filter of one DOF with measurements of its tip, for records of other instruments.
#[derive(Debug, Clone, PartialEq)]
pub struct TipFilter {
    filter: Filter,
    std: f64,
    command: Option<f64>,
}

impl TipFilter {
    /// The filter before the first command, for half widths of at most `unit` and a measured tip of standard deviation
    /// `std`; both in the unit of the command.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        settings: StateEstimationSettings,
        unit: f64,
        std: f64,
    ) -> Result<Self, ConfigError> {
        crate::error::require_positive("std", std)?;
        let unknown = Play::from_ordered(0.0, 0.0);
        Ok(Self {
            filter: Filter::new(settings, [unit; 3], [unit; 3], [unknown; 3], 1.0)?,
            std,
            command: None,
        })
    }

    /// The predicted tip for the next command.
    pub fn step(&mut self, command: f64) -> f64 {
        let all = [command, 0.0, 0.0];
        match self.command.replace(command) {
            None => self.filter.start(all, all),
            Some(last) => {
                self.filter.step([last, 0.0, 0.0], all, f64::INFINITY);
                self.filter.follow(core::iter::once((all, all)));
            }
        }
        let nominal = self.filter.nominal();
        let [tip, ..] = nominal.tip(nominal.position.output);
        tip
    }

    /// Updates the estimate with the tip measured at the last command; one that is not finite updates nothing.
    pub fn update(&mut self, tip: f64) {
        if !tip.is_finite() || self.command.is_none() {
            return;
        }
        let measurement = TipMeasurement {
            by_tip: [1.0 / self.std, 0.0, 0.0],
            by_geometry: [0.0; GEOMETRY],
            value: tip / self.std,
        };
        self.filter
            .update_with(&[measurement], [tip, 0.0, 0.0], false);
    }

    /// The estimated play.
    pub fn play(&self) -> Play {
        let [play, ..] = self.filter.plays();
        play
    }

    /// Travel of the tip over that of the command in contact.
    pub fn gain(&self) -> f64 {
        let [gain, ..] = self.filter.nominal().gain;
        gain
    }
}
