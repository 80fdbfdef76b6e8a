//! The result of an image update.

use crate::article::estimator::Triggers;
use crate::article::play::Play;
use crate::article::state::StateEstimate;
use crate::dof::PerDof;
use crate::supervision::supervisor::Supervision;

/// Result of an image update.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Every DOF was measured.
    Ok,
    /// At least one DOF was not observable and was held.
    Held,
    /// Only one marker was used; the DOFs that it does not determine were held.
    Partial,
    /// The markers were not found.
    NoMarkers,
    /// The frame was captured at a time beyond the history.
    Stale,
    /// The frame was captured no later than one already used.
    Duplicate,
    /// A monitor refused the frame: it updated nothing.
    Refused,
}

/// The image update of a frame; unknown values are NaN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// Whether the frame was used, or why not.
    pub status: Status,
    /// q at the capture time [m, rad, rad].
    pub predicted_state: PerDof<f64>,
    /// h in px of the state the estimate started from: q, or the state predicted from the last images.
    pub predicted_features: [f64; 4],
    /// `q_hat`, innovation and which DOFs are observable.
    pub estimate: StateEstimate,
    /// Standard deviation of each DOF of `q_hat` [m, rad, rad].
    pub state_deviation: PerDof<f64>,
    /// Which offsets were updated, and why.
    pub triggers: PerDof<Triggers>,
    /// The estimated play after the update [m, rad, rad].
    pub play: PerDof<Play>,
    /// State of the supervision after the update.
    pub supervision: Supervision,
}

/// The estimated slack of N DOFs [m or rad].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlackEstimate<const N: usize> {
    /// Half widths.
    pub half_width: [f64; N],
    /// Standard deviations of the half widths; NaN in profile `paper`.
    pub width_std: [f64; N],
    /// Centres of the contact offsets, input minus output.
    pub centre: [f64; N],
    /// Travel of the tip over that of the command in contact; 1 in profile `paper`.
    pub gain: [f64; N],
    /// Standard deviations of the gains; NaN in profile `paper`.
    pub gain_std: [f64; N],
}

/// What profile `best` estimates of the article's instrument beside its slack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometryEstimate {
    /// Share of the friction that insertion and rotation have in common, 0 to 1.
    pub shared: f64,
    /// Unevenness of the section's curvature: half of the difference of its ends, over the mean.
    pub unevenness: f64,
    /// Shift of the image (2,) in px against the configured camera.
    pub image_shift: [f64; 2],
    /// Its standard deviations (2,) in px.
    pub image_shift_std: [f64; 2],
}

impl GeometryEstimate {
    /// As [`crate::FeatureModel::with_geometry`] has it: unevenness, shift (2,) in px.
    #[must_use]
    pub const fn errors(&self) -> [f64; 3] {
        let [u, v] = self.image_shift;
        [self.unevenness, u, v]
    }
}
