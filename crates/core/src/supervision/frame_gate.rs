//! Frame gate: whether a frame is used, by its times, by its image, and by the innovation (innovation gate).

use crate::error::{ConfigError, require_all_positive};
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::settings::SafetySettings;

/// What identifies an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageIdentity {
    /// A checksum of the pixels.
    Checksum(u64),
    /// The bits of the features.
    Features([u64; 4]),
}

/// A frame on arrival.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameArrival<const N: usize> {
    /// Capture time, in s.
    pub captured_at: f64,
    /// Time of the newest control tick, in s.
    pub now: f64,
    /// None if neither pixels nor features are known.
    pub image: Option<ImageIdentity>,
    /// Whether all that it measures is stuck.
    pub is_stuck: bool,
    /// Path length of the command at the capture time [m or rad]. None where the history does not reach.
    pub travel: Option<[f64; N]>,
}

/// Accepts or refuses frames, by their times, their images and their innovation.
///
/// A frame is refused whose innovation is beyond `innovation_limit`, in standard deviations of prediction and measurement
/// together (Mahalanobis distance).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameGate<const N: usize> {
    settings: SafetySettings<N>,
    /// [m or rad], as all lengths below.
    pub(super) frozen_travel: [f64; N],
    captured_at: Option<f64>,
    arrived_at: Option<f64>,
    /// The image that frames since then repeat, and the path length of the command then.
    repeated: Option<(ImageIdentity, [f64; N])>,
}

impl<const N: usize> FrameGate<N> {
    /// The gate before the first frame.
    ///
    /// # Errors
    /// A value is not a finite number above 0.
    pub fn new(safety: &SafetySettings<N>, dofs: &[DofSettings; N]) -> Result<Self, ConfigError> {
        let frozen_travel = dofs.map(|dof| dof.update_distance * safety.frozen_travel);
        require_all_positive(&[
            ("frame_age", &[safety.frame_age]),
            ("frame_gap", &[safety.frame_gap]),
            ("clock_jump", &[safety.clock_jump]),
            ("innovation_limit", &[safety.innovation_limit]),
            ("frozen_travel", &frozen_travel),
        ])?;
        Ok(Self {
            settings: *safety,
            frozen_travel,
            captured_at: None,
            arrived_at: None,
            repeated: None,
        })
    }

    /// Whether no frame has arrived yet.
    pub(crate) const fn is_unused(&self) -> bool {
        self.arrived_at.is_none()
    }

    /// Check at a control tick that frames arrive. None is missing before the first.
    pub fn check_gap(&mut self, time: f64) -> Flags {
        // A clock that was set back restarts the gap.
        self.arrived_at = self.arrived_at.map(|last| last.min(time));
        let gap = self.arrived_at.map_or(0.0, |last| time - last);
        Flags::when(gap > self.settings.frame_gap, Flag::Dropped)
    }

    /// Check the times and the image of a frame, before its features.
    pub fn check_arrival(&mut self, arrival: &FrameArrival<N>) -> Flags {
        let FrameArrival {
            captured_at, now, ..
        } = *arrival;
        if now.is_finite() {
            self.arrived_at = Some(now);
        }
        let since = self.captured_at.map(|last| captured_at - last);
        let is_ahead = captured_at > now && arrival.travel.is_none();
        let has_jumped = since.is_some_and(|since| since < -self.settings.clock_jump);
        if !captured_at.is_finite() || is_ahead || has_jumped {
            // The next frame is compared with the new time.
            self.captured_at = Some(captured_at).filter(|_| has_jumped);
            return Flags::of(Flag::Clock);
        }
        self.captured_at = Some(captured_at);
        Flags::when(now - captured_at > self.settings.frame_age, Flag::Late).union(Flags::when(
            arrival.is_stuck || self.is_frozen(arrival),
            Flag::Frozen,
        ))
    }

    fn is_frozen(&mut self, arrival: &FrameArrival<N>) -> bool {
        let (Some(image), Some(travel)) = (arrival.image, arrival.travel) else {
            return false;
        };
        match self.repeated {
            Some((repeated, then)) if repeated == image => {
                let mut dofs = travel.iter().zip(then).zip(self.frozen_travel);
                dofs.any(|((now, then), limit)| now - then >= limit)
            }
            _ => {
                self.repeated = Some((image, travel));
                false
            }
        }
    }

    /// Check the Mahalanobis distance of the innovation.
    pub fn check_innovation(&self, distance: f64) -> Flags {
        Flags::when(distance > self.settings.innovation_limit, Flag::Innovation)
    }
}
