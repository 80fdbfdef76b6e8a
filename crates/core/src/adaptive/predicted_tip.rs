//! The tip that the estimate predicts for a command.

use crate::dof::PerDof;
use crate::estimation::filter::Filter;
use crate::estimation::nominal::Nominal;
use crate::model::hysteresis::{Hysteresis, PlayPosition};

/// Prediction of the tip after a motion from one command, with the contact a standard deviation nearer than estimated.
#[derive(Debug, Clone, Copy)]
pub struct PredictedTip<'a> {
    nominal: &'a Nominal,
    plays: Hysteresis,
    radius: f64,
    from: PerDof<f64>,
    position: PlayPosition,
}

impl<'a> PredictedTip<'a> {
    /// The prediction of a filter at a command (3,) [m, rad, rad].
    pub fn new(filter: &'a Filter, from: PerDof<f64>) -> Self {
        let (nominal, radius) = (filter.nominal(), filter.radius());
        let mut plays = nominal.hysteresis;
        for (half, std) in plays.half_width.iter_mut().zip(nominal.width_std) {
            *half *= libm::exp(-std);
        }
        let position = plays.propagate(radius, &nominal.position, from, from);
        Self {
            nominal,
            plays,
            radius,
            from,
            position,
        }
    }

    /// The tip at the command (3,) [m, rad, rad].
    pub fn now(&self) -> PerDof<f64> {
        self.nominal.tip(self.position.output)
    }

    /// The tip after a motion to another command (3,) [m, rad, rad].
    pub fn after(&self, command: PerDof<f64>) -> PerDof<f64> {
        let moved = self
            .plays
            .propagate(self.radius, &self.position, self.from, command);
        self.nominal.tip(moved.output)
    }
}
