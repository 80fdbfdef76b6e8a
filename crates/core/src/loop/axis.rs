//! One DOF of the loop: its law, and the estimate of its offsets.

use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use crate::supervision::monitors::Law;

/// One DOF, whatever the profile; every quantity in its unit.
pub trait Axis: Law {
    /// The predicted state q; NaN before the first reference.
    fn predicted_state(&self) -> f64;

    /// The estimated play where the DOF is now.
    fn play(&self) -> Play;

    /// Least and largest offset that the estimate allows where the DOF is now.
    fn offsets(&self) -> (f64, f64);

    /// Limit the estimate of the offsets.
    fn set_limit(&mut self, limit: PlayLimit);

    /// The limit of the estimate.
    fn play_limit(&self) -> PlayLimit;

    /// Update the offsets from command and output of one instant, the output's standard deviation, and the commands
    /// since, oldest first.
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

/// What an image changed of the offsets of a DOF.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OffsetUpdate {
    /// Which offsets were updated, and why.
    pub triggers: Triggers,
    /// Whether the limit bounded the update.
    pub is_limited: bool,
    /// Change of (`delta_minus`, `delta_plus`) where the DOF is; 0 in profile `paper`, where any one image may change
    /// all.
    pub change: [f64; 2],
}
