//! One DOF of the loop: compensation law and offset estimate.

use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::supervision::monitors::Law;

/// One DOF of either profile; every quantity is in its unit.
pub trait Axis: Law {
    /// The predicted state q; NaN before the first reference.
    fn predicted_state(&self) -> f64;

    /// The estimated play at the present position of the DOF.
    fn play(&self) -> Play;

    /// Least and largest offset that the estimate allows at the present position of the DOF.
    fn offsets(&self) -> (f64, f64);

    /// Sets the limit of the estimated offsets.
    fn set_limit(&mut self, limit: PlayLimit);

    /// The limit of the estimated offsets.
    fn play_limit(&self) -> PlayLimit;

    /// Updates the offsets from command and output of one instant, the output's standard deviation, and the commands
    /// since then, oldest first.
    fn update_offsets(
        &mut self,
        command: f64,
        measured: f64,
        deviation: f64,
        since: impl Iterator<Item = f64>,
    ) -> OffsetUpdate;

    /// [`Axis::update_offsets`] for an offset within the limit; any other updates nothing.
    fn update_within_limit(
        &mut self,
        command: f64,
        measured: f64,
        deviation: f64,
        since: impl Iterator<Item = f64>,
    ) -> OffsetUpdate {
        if self.play_limit().allows(command - measured) {
            return self.update_offsets(command, measured, deviation, since);
        }
        OffsetUpdate {
            is_limited: true,
            ..OffsetUpdate::default()
        }
    }
}

/// Result of the offset update of a DOF.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OffsetUpdate {
    /// Which offsets were updated, and why.
    pub triggers: Triggers,
    /// Whether the limit bounded the update.
    pub is_limited: bool,
    /// Change of (`delta_minus`, `delta_plus`) at the position of the DOF; 0 in profile `paper`, whose changes are not
    /// monitored.
    pub change: [f64; 2],
}
