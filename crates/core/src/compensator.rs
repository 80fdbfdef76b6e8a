//! The limited-gain inverse of the hysteresis, Eqs. (2)-(3), Fig. 2.

use crate::error::{ConfigError, require};
use crate::play::Play;

/// Turns a reference into a command that crosses the slack faster, Eqs. (2)-(3), Fig. 2.
///
/// ```text
/// dc = K du,   0 <= K <= gain_limit;   K = 1 in contact,   K = free_gain in the free zone
/// ```
///
/// with reference u, command c, position p = c - q in the play and predicted state q, all in the
/// unit of the DOF. A tick that ends the free zone is split exactly at the contact; in closed form
///
/// ```text
/// p <- clamp(p + free_gain du, delta_minus, delta_plus)
/// c <- u + anchor + (1 - 1 / free_gain) p
/// ```
///
/// so c - u - (1 - 1 / `free_gain`) p is constant and nothing drifts, however many reversals come.
/// What remains of a slack of width w is w / `free_gain`.
///
/// Wrong when the width is over-estimated: the tip overshoots by
/// max(0, estimated width (1 - 1 / `free_gain`) - true width).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compensator {
    free_gain: f64,
    gain_limit: f64,
}

/// The memory of a [`Compensator`]: the play it believes in and where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompensatorState {
    play: Play,
    position: f64,
    reference: Option<f64>,
    command: f64,
    anchor: f64,
}

impl CompensatorState {
    /// Before the first reference; the position in the play is the one nearest to zero.
    pub fn new(play: Play) -> Self {
        Self {
            play,
            position: play.clamp(0.0),
            reference: None,
            command: f64::NAN,
            anchor: 0.0,
        }
    }

    /// The play operator believed in.
    pub const fn play(&self) -> Play {
        self.play
    }

    /// p = c - q, the position between the contacts.
    pub const fn position(&self) -> f64 {
        self.position
    }

    /// The command c; NaN before the first reference.
    pub const fn command(&self) -> f64 {
        self.command
    }

    /// The predicted state q = c - p; NaN before the first reference.
    pub fn predicted_state(&self) -> f64 {
        self.command - self.position
    }
}

impl Compensator {
    /// A compensator with `free_gain` (`K_b` in the article) in the free zone; 1 compensates nothing.
    ///
    /// # Errors
    /// A gain is not finite, `free_gain` is below 1, or above `gain_limit`.
    pub fn new(free_gain: f64, gain_limit: f64) -> Result<Self, ConfigError> {
        let limit = gain_limit.is_finite() && gain_limit >= 1.0;
        require(
            limit,
            "gain_limit",
            gain_limit,
            "a finite number, 1 or above",
        )?;
        let gain = free_gain >= 1.0 && free_gain <= gain_limit;
        require(
            gain,
            "free_gain",
            free_gain,
            "at least 1, at most gain_limit",
        )?;
        Ok(Self {
            free_gain,
            gain_limit,
        })
    }

    /// The command for the next reference.
    ///
    /// The first reference is passed through. A reference that has not changed, or is not
    /// finite, gives the same command again, bit for bit.
    pub fn step(&self, state: &mut CompensatorState, reference: f64) -> f64 {
        if !reference.is_finite() {
            return state.command;
        }
        let Some(last) = state.reference.replace(reference) else {
            state.command = reference;
            self.retune(state, state.play);
            return state.command;
        };
        let increment = reference - last;
        if increment == 0.0 {
            return state.command;
        }
        state.position = state
            .play
            .clamp(state.position + self.free_gain * increment);
        let command = reference + state.anchor + self.surplus() * state.position;
        // Only rounding ever reaches these bounds: Eq. (2) then holds to the last bit.
        let farthest = state.command + self.gain_limit * increment;
        state.command = command
            .max(state.command.min(farthest))
            .min(state.command.max(farthest));
        state.command
    }

    /// Go on from here with other offsets, or with this compensator after another: bumpless.
    ///
    /// The command does not move. The position moves only as far as the new contacts push it.
    pub fn retune(&self, state: &mut CompensatorState, play: Play) {
        state.play = play;
        state.position = play.clamp(state.position);
        if let Some(reference) = state.reference {
            state.anchor = state.command - reference - self.surplus() * state.position;
        }
    }

    /// 1 - 1 / `free_gain`: the share of the position by which the command leads the reference.
    fn surplus(&self) -> f64 {
        1.0 - 1.0 / self.free_gain
    }
}
