//! Whether a frame may teach: its time, its picture, and what it says of the state.

use crate::dof::PerDof;
use crate::error::{ConfigError, require_non_negative, require_positive};
use crate::estimation::posture::Belief;
use crate::math::linear::square;
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::grip::{Grip, GripSettings, Sighting};
use crate::supervision::settings::SafetySettings;

/// A frame out of order by more than this has a wrong clock, in s.
const BACK: f64 = 1.0;
/// Share of the difference by which the spread follows a larger innovation, and a smaller one of a DOF in motion.
const GROW: f64 = 0.3;
const SHRINK: f64 = 0.05;

/// So many of the image's own standard deviations are no jump.
const JUMP_DEVIATIONS: f64 = 2.0;

/// When a frame is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameGateSettings {
    /// Oldest frame that is used, in s.
    pub frame_age: f64,
    /// Longest time without a frame, in s.
    pub frame_gap: f64,
    /// Travel of the command after which no picture repeats itself [m, rad, rad].
    pub frozen_travel: PerDof<f64>,
    /// Largest innovation, in standard deviations.
    pub innovation_limit: f64,
    /// Spread of the innovations at the start [m, rad, rad].
    pub start_deviation: PerDof<f64>,
    /// Least spread [m, rad, rad].
    pub least_deviation: PerDof<f64>,
    /// How far a tip may come beyond its command's travel between two images [m, rad, rad].
    pub jump: PerDof<f64>,
    /// When a tip is in contact, and has left it.
    pub grips: PerDof<GripSettings>,
    /// What spread and jump grow by while nothing is seen, per travel of the command.
    pub blind_growth: f64,
}

/// A picture as far as it can be told from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageIdentity {
    /// A checksum of its pixels.
    Checksum(u64),
    /// The bits of the features in it.
    Features([u64; 4]),
}

/// A frame as it comes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameArrival {
    /// In s.
    pub captured_at: f64,
    /// Of the newest control tick, in s.
    pub now: f64,
    /// None if neither pixels nor features are known.
    pub picture: Option<ImageIdentity>,
    /// How far the command had gone at capture, forth and back [m, rad, rad]; None beyond the history.
    pub travel: Option<PerDof<f64>>,
}

/// Watches the frames.
///
/// The innovation of a DOF is what the image alone says less what model and last images make one expect. It is refused
/// beyond
///
/// ```text
/// innovation^2 > innovation_limit^2 (spread^2 + deviation^2)
/// ```
///
/// with the image's own standard deviation from the markers' covariance, and a spread that follows the root mean square
/// of the innovations accepted: quickly when they grow, slowly and with motion when they shrink. A refused innovation teaches it nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameGate {
    settings: FrameGateSettings,
    captured_at: Option<f64>,
    arrived_at: Option<f64>,
    first: Option<(ImageIdentity, PerDof<f64>)>,
    spread: PerDof<f64>,
    /// By how much a jump may be larger [m, rad, rad].
    blind: PerDof<f64>,
    travel: PerDof<f64>,
    grips: PerDof<Grip>,
}

impl FrameGate {
    /// Before the first frame.
    ///
    /// # Errors
    /// A value is not a finite number above 0; the growth may be 0.
    pub fn new(safety: &SafetySettings, dofs: &PerDof<DofSettings>) -> Result<Self, ConfigError> {
        let [i, r, b] = dofs;
        let each = |of: &dyn Fn(&DofSettings) -> f64| [of(i), of(r), of(b)];
        let [s1, s2, s3] = safety.slip;
        let [g1, g2, g3] = each(&|dof| dof.update_distance * safety.grip_distance);
        let settings = FrameGateSettings {
            frame_age: safety.frame_age,
            frame_gap: safety.frame_gap,
            frozen_travel: each(&|dof| dof.update_distance * safety.frozen_travel),
            innovation_limit: safety.innovation_limit,
            start_deviation: each(&|dof| dof.start_deviation),
            least_deviation: each(&|dof| dof.start_deviation * safety.innovation_floor),
            jump: safety.jump,
            grips: [
                GripSettings {
                    distance: g1,
                    slip: s1,
                },
                GripSettings {
                    distance: g2,
                    slip: s2,
                },
                GripSettings {
                    distance: g3,
                    slip: s3,
                },
            ],
            blind_growth: safety.blind_growth,
        };
        require_positive("frame_age", settings.frame_age)?;
        require_positive("frame_gap", settings.frame_gap)?;
        require_positive("innovation_limit", settings.innovation_limit)?;
        require_non_negative("blind_growth", settings.blind_growth)?;
        for value in settings.frozen_travel {
            require_positive("frozen_travel", value)?;
        }
        for value in settings.start_deviation {
            require_positive("start_deviation", value)?;
        }
        for value in settings.jump {
            require_positive("jump", value)?;
        }
        for grip in settings.grips {
            require_positive("grip_distance", grip.distance)?;
            require_positive("slip", grip.slip)?;
        }
        for value in settings.least_deviation {
            require_positive("innovation_floor", value)?;
        }
        Ok(Self {
            settings,
            captured_at: None,
            arrived_at: None,
            first: None,
            spread: settings.start_deviation,
            blind: settings.start_deviation,
            travel: [0.0; 3],
            grips: settings.grips.map(Grip::new),
        })
    }

    /// At a control tick: whether frames stay away. Before the first there is none to miss.
    pub fn tick(&self, time: f64) -> Flags {
        let gap = self.arrived_at.map_or(0.0, |last| time - last);
        Flags::when(gap > self.settings.frame_gap, Flag::Dropped)
    }

    /// What is wrong with a frame before anyone looks at the features.
    pub fn arrive(&mut self, arrival: &FrameArrival) -> Flags {
        let FrameArrival {
            captured_at, now, ..
        } = *arrival;
        if now.is_finite() {
            self.arrived_at = Some(now);
        }
        let since = self.captured_at.map(|last| captured_at - last);
        let is_ahead = captured_at > now && arrival.travel.is_none();
        let has_jumped = since.is_some_and(|since| since < -BACK);
        if !captured_at.is_finite() || is_ahead || has_jumped {
            // What comes next is compared with the new time.
            self.captured_at = Some(captured_at).filter(|_| has_jumped);
            return Flags::of(Flag::Clock);
        }
        self.captured_at = Some(captured_at);
        Flags::when(now - captured_at > self.settings.frame_age, Flag::Late)
            .union(Flags::when(self.repeats(arrival), Flag::Frozen))
    }

    fn repeats(&mut self, arrival: &FrameArrival) -> bool {
        let (Some(picture), Some(travel)) = (arrival.picture, arrival.travel) else {
            return false;
        };
        match self.first {
            Some((first, then)) if first == picture => travel
                .iter()
                .zip(then)
                .zip(self.settings.frozen_travel)
                .any(|((now, then), limit)| now - then >= limit),
            _ => {
                self.first = Some((picture, travel));
                false
            }
        }
    }

    /// What cannot be believed of an image, of which each DOF says what is seen of it; how far the tip may have gone
    /// since the last.
    pub fn doubts(&self, belief: &Belief, moved: PerDof<f64>, seen: &PerDof<Sighting>) -> Flags {
        let reach = moved.iter().zip(self.settings.jump).zip(self.blind);
        let axes = seen.iter().zip(belief.state).zip(self.spread).zip(reach);
        let mut doubts = Flags::NONE;
        for ((((seen, expected), spread), ((moved, jump), blind)), grip) in axes.zip(&self.grips) {
            let (surprise, deviation) = ((seen.tip - expected).abs(), seen.deviation);
            if !(surprise.is_finite() && deviation.is_finite()) {
                continue;
            }
            let limit = square(self.settings.innovation_limit);
            let fits = square(surprise) <= limit * (square(spread) + square(deviation));
            let reaches = surprise <= moved + jump + blind + JUMP_DEVIATIONS * deviation;
            doubts = doubts
                .union(Flags::when(!fits, Flag::Innovation))
                .union(Flags::when(!reaches, Flag::Jump))
                .union(Flags::when(grip.slips(seen), Flag::Slip));
        }
        doubts
    }

    /// An image was believed.
    pub fn accept(&mut self, belief: &Belief, seen: &PerDof<Sighting>) {
        let axes = seen.iter().zip(belief.state).zip(&mut self.spread);
        let axes = axes.zip(self.travel).zip(self.settings.least_deviation);
        for (((((seen, expected), spread), then), least), grip) in axes.zip(&mut self.grips) {
            let surprise = square(seen.tip - expected);
            if surprise.is_finite() {
                let change = surprise - square(*spread);
                let rate = if change > 0.0 {
                    GROW
                } else {
                    // A DOF at rest shows nothing of how well its motion is foreseen.
                    SHRINK * ((seen.travel - then) / least).min(1.0)
                };
                *spread = libm::sqrt(square(*spread) + rate * change).max(least);
            }
            grip.follow(seen);
        }
        self.blind = [0.0; 3];
        self.travel = seen.map(|seen| seen.travel);
    }

    /// Nothing was seen.
    pub fn miss(&mut self, travel: PerDof<f64>) {
        let moved = travel.iter().zip(self.travel);
        let axes = self.spread.iter_mut().zip(&mut self.blind);
        let axes = axes.zip(self.settings.start_deviation);
        for (((spread, blind), most), (now, then)) in axes.zip(moved) {
            let growth = self.settings.blind_growth * (now - then).max(0.0);
            *spread = (*spread + growth).min(most).max(*spread);
            *blind = (*blind + growth).min(most);
        }
        self.travel = travel;
    }

    /// What has been refused for so long may be the truth: believe the next images again.
    pub const fn forget(&mut self) {
        self.spread = self.settings.start_deviation;
        self.blind = self.settings.start_deviation;
        let [first, second, third] = &mut self.grips;
        first.release();
        second.release();
        third.release();
    }
}
