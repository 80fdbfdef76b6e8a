//! What is said of a frame.

use super::HysteresisReduction;
use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::state::StateEstimate;
use crate::dof::PerDof;
use crate::r#loop::history::Entry;
use crate::supervision::monitors::Supervision;

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Every DOF was measured.
    Ok,
    /// Some DOF could not be observed and was held.
    Held,
    /// Only one marker was found, or could be believed; what it does not determine was held.
    Partial,
    /// The markers were not found.
    NoMarkers,
    /// Captured at a time the history does not reach.
    Stale,
    /// Captured no later than a frame already used.
    Duplicate,
    /// A guard did not believe it: it taught nothing.
    Refused,
}

/// What the loop made of a frame; NaN is what is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// What became of the frame.
    pub status: Status,
    /// q at the capture time [m, rad, rad].
    pub predicted_state: PerDof<f64>,
    /// h of the state the estimate started from in px: q, or what the last images said.
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

impl HysteresisReduction {
    /// The report on a frame that taught nothing.
    pub(super) fn unused(&self, status: Status, past: Option<Entry>) -> Report {
        let predicted_state = past.map_or([f64::NAN; 3], |past| past.predicted_state);
        let prediction = self.feature_model.predict(predicted_state);
        Report {
            status,
            predicted_state,
            predicted_features: prediction.map_or([f64::NAN; 4], |prediction| prediction.features),
            estimate: StateEstimate {
                state: predicted_state,
                observable: [false; 3],
                deviation: [f64::NAN; 3],
                innovation: [f64::NAN; 4],
                inverse: [[0.0; 4]; 3],
            },
            state_deviation: [f64::NAN; 3],
            triggers: [Triggers::default(); 3],
            play: self.play(),
            supervision: self.monitors.supervision(),
        }
    }
}
