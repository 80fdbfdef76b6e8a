//! Frame gate: whether a frame is used, by its times, by its image, and by the innovation (innovation gate).

use crate::dof::PerDof;
use crate::error::{ConfigError, require, require_non_negative, require_positive};
use crate::estimation::posture::Belief;
use crate::math::linear::square;
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::grip::{Grip, GripSettings, Sighting};
use crate::supervision::settings::SafetySettings;

/// Coverage factor of the image's standard deviation in the bound of a jump: 95 % of a normal distribution.
const COVERAGE: f64 = 2.0;

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
pub struct FrameArrival {
    /// Capture time, in s.
    pub captured_at: f64,
    /// Time of the newest control tick, in s.
    pub now: f64,
    /// None if neither pixels nor features are known.
    pub image: Option<ImageIdentity>,
    /// Path length of the command at the capture time [m, rad, rad]; None where the history does not reach.
    pub travel: Option<PerDof<f64>>,
}

/// Accepts or refuses frames.
///
/// The innovation of a DOF, measured less predicted state, is refused if
///
/// ```text
/// innovation^2 > innovation_limit^2 (std^2 + deviation^2)
/// ```
///
/// with the standard deviation `deviation` of the measurement, from the covariance of the markers, and that of the
/// innovations so far,
///
/// ```text
/// std^2 <- std^2 + a (innovation^2 - std^2),   a = innovation_growth where it grows, else innovation_decay
/// ```
///
/// where the decay also needs motion. Only accepted frames update it. A jump is an innovation beyond the travel of the
/// command, `jump` and two `deviation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameGate {
    settings: SafetySettings,
    /// [m, rad, rad], as all lengths below.
    frozen_travel: PerDof<f64>,
    start_std: PerDof<f64>,
    least_std: PerDof<f64>,
    captured_at: Option<f64>,
    arrived_at: Option<f64>,
    /// The image that frames since then repeat, and the path length of the command then.
    repeated: Option<(ImageIdentity, PerDof<f64>)>,
    innovation_std: PerDof<f64>,
    /// What is added to `jump` for motion without a marker.
    jump_margin: PerDof<f64>,
    travel: PerDof<f64>,
    grips: PerDof<Grip>,
}

impl FrameGate {
    /// The gate before the first frame.
    ///
    /// # Errors
    /// A value is not a finite number above 0 (`blind_growth` may be 0), or a smoothing factor is above 1.
    pub fn new(safety: &SafetySettings, dofs: &PerDof<DofSettings>) -> Result<Self, ConfigError> {
        let start_std = dofs.map(|dof| dof.start_deviation);
        let least_std = dofs.map(|dof| dof.start_deviation * safety.innovation_floor);
        let frozen_travel = dofs.map(|dof| dof.update_distance * safety.frozen_travel);
        let [grip1, grip2, grip3] = dofs.map(|dof| dof.update_distance * safety.grip_distance);
        let [slip1, slip2, slip3] = safety.slip;
        let grips = [(grip1, slip1), (grip2, slip2), (grip3, slip3)]
            .map(|(distance, slip)| GripSettings { distance, slip });
        for (field, value) in [
            ("frame_age", safety.frame_age),
            ("frame_gap", safety.frame_gap),
            ("clock_jump", safety.clock_jump),
            ("innovation_limit", safety.innovation_limit),
        ] {
            require_positive(field, value)?;
        }
        require_non_negative("blind_growth", safety.blind_growth)?;
        for (field, factor) in [
            ("innovation_growth", safety.innovation_growth),
            ("innovation_decay", safety.innovation_decay),
        ] {
            let is_factor = factor > 0.0 && factor <= 1.0;
            require(is_factor, field, factor, "a number above 0, at most 1")?;
        }
        for (field, values) in [
            ("frozen_travel", frozen_travel),
            ("start_deviation", start_std),
            ("jump", safety.jump),
            ("grip_distance", grips.map(|grip| grip.distance)),
            ("slip", safety.slip),
            ("innovation_floor", least_std),
        ] {
            for value in values {
                require_positive(field, value)?;
            }
        }
        Ok(Self {
            settings: *safety,
            frozen_travel,
            start_std,
            least_std,
            captured_at: None,
            arrived_at: None,
            repeated: None,
            innovation_std: start_std,
            jump_margin: start_std,
            travel: [0.0; 3],
            grips: grips.map(Grip::new),
        })
    }

    /// Check at a control tick that frames arrive. None is missing before the first.
    pub fn check_gap(&self, time: f64) -> Flags {
        let gap = self.arrived_at.map_or(0.0, |last| time - last);
        Flags::when(gap > self.settings.frame_gap, Flag::Dropped)
    }

    /// Check the times and the image of a frame, before its features.
    pub fn check_arrival(&mut self, arrival: &FrameArrival) -> Flags {
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
        Flags::when(now - captured_at > self.settings.frame_age, Flag::Late)
            .union(Flags::when(self.is_frozen(arrival), Flag::Frozen))
    }

    fn is_frozen(&mut self, arrival: &FrameArrival) -> bool {
        let (Some(image), Some(travel)) = (arrival.image, arrival.travel) else {
            return false;
        };
        match self.repeated {
            Some((repeated, then)) if repeated == image => travel
                .iter()
                .zip(then)
                .zip(self.frozen_travel)
                .any(|((now, then), limit)| now - then >= limit),
            _ => {
                self.repeated = Some((image, travel));
                false
            }
        }
    }

    /// Check what was measured of each DOF against the prediction, where the tip may have moved by `moved` since the
    /// last image.
    pub fn check_innovation(
        &self,
        prediction: &Belief,
        moved: PerDof<f64>,
        measured: &PerDof<Sighting>,
    ) -> Flags {
        let reach = moved.iter().zip(self.settings.jump).zip(self.jump_margin);
        let stds = prediction.state.into_iter().zip(self.innovation_std);
        let mut flags = Flags::NONE;
        for (((seen, (predicted, std)), ((moved, jump), margin)), grip) in
            measured.iter().zip(stds).zip(reach).zip(&self.grips)
        {
            let (innovation, deviation) = ((seen.tip - predicted).abs(), seen.deviation);
            if !(innovation.is_finite() && deviation.is_finite()) {
                continue;
            }
            let limit = square(self.settings.innovation_limit);
            let fits = square(innovation) <= limit * (square(std) + square(deviation));
            let is_reachable = innovation <= moved + jump + margin + COVERAGE * deviation;
            flags = flags
                .union(Flags::when(!fits, Flag::Innovation))
                .union(Flags::when(!is_reachable, Flag::Jump))
                .union(Flags::when(grip.slips(seen), Flag::Slip));
        }
        flags
    }

    /// Update the standard deviation of the innovation with a frame that was accepted.
    pub fn accept(&mut self, prediction: &Belief, measured: &PerDof<Sighting>) {
        let axes = measured.iter().zip(prediction.state);
        let axes = axes.zip(&mut self.innovation_std).zip(self.travel);
        for (((((seen, predicted), std), then), least), grip) in
            axes.zip(self.least_std).zip(&mut self.grips)
        {
            let variance = square(seen.tip - predicted);
            if variance.is_finite() {
                let change = variance - square(*std);
                let factor = if change > 0.0 {
                    self.settings.innovation_growth
                } else {
                    // At rest an innovation does not show how well motion is predicted.
                    self.settings.innovation_decay * ((seen.travel - then) / least).min(1.0)
                };
                *std = libm::sqrt(square(*std) + factor * change).max(least);
            }
            grip.follow(seen);
        }
        self.jump_margin = [0.0; 3];
        self.travel = measured.map(|seen| seen.travel);
    }

    /// Widen the bounds after a frame without a marker.
    pub fn miss(&mut self, travel: PerDof<f64>) {
        let moved = travel.iter().zip(self.travel);
        let axes = self.innovation_std.iter_mut().zip(&mut self.jump_margin);
        let axes = axes.zip(self.start_std);
        for (((std, margin), most), (now, then)) in axes.zip(moved) {
            let growth = self.settings.blind_growth * (now - then).max(0.0);
            *std = (*std + growth).min(most).max(*std);
            *margin = (*margin + growth).min(most);
        }
        self.travel = travel;
    }

    /// Return to the wide bounds of the start, after which frames that were refused for long are accepted.
    pub const fn reset(&mut self) {
        self.innovation_std = self.start_std;
        self.jump_margin = self.start_std;
        let [first, second, third] = &mut self.grips;
        first.release();
        second.release();
        third.release();
    }
}
