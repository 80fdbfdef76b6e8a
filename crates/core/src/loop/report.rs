//! The result of an image update.

use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::state::StateEstimate;
use crate::dof::PerDof;
use crate::supervision::monitors::Supervision;

/// Result of an image update.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Every DOF was measured.
    Ok,
    /// Some DOF could not be observed and was held.
    Held,
    /// Only one marker was used; what it does not determine was held.
    Partial,
    /// The markers were not found.
    NoMarkers,
    /// Captured at a time the history does not reach.
    Stale,
    /// Captured no later than a frame already used.
    Duplicate,
    /// A monitor refused it: it updated nothing.
    Refused,
}

/// The image update of a frame; NaN is what is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// What became of the frame.
    pub status: Status,
    /// q at the capture time [m, rad, rad].
    pub predicted_state: PerDof<f64>,
    /// h in px of the state the estimate started from: q, or the state predicted from the last images.
    pub predicted_features: [f64; 4],
    /// `q_hat`, innovation and what could be observed.
    pub estimate: StateEstimate,
    /// Standard deviation of each DOF of `q_hat` [m, rad, rad].
    pub state_deviation: PerDof<f64>,
    /// Which offsets were updated, and why.
    pub triggers: PerDof<Triggers>,
    /// The offsets from now on [m, rad, rad].
    pub play: PerDof<Play>,
    /// What is in force from now on, and why.
    pub supervision: Supervision,
}
