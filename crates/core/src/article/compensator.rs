//! The limited-gain inverse of the play operator, Eqs. (2)-(3), Fig. 2.

use crate::article::play::{Play, PlayState};
use crate::error::{ConfigError, require};

/// Turns a reference into a command that crosses the slack faster, Eqs. (2)-(3), Fig. 2.
///
/// ```text
/// dc = K du,   0 <= K <= gain_limit;   K = 1 in contact,   K = free_gain in the free zone
/// ```
///
/// with reference u, command c, predicted state q (the play model driven by c) and position
/// p = c - q, all in the unit of the DOF. A tick that ends the free zone is split exactly at the
/// contact: the closed form below has no increments, so nothing accumulates.
///
/// ```text
/// c = u + anchor + (1 - 1 / free_gain) clamp(free_gain (u + anchor - q), delta_minus, delta_plus)
/// ```
///
/// c - u - (1 - 1 / `free_gain`) p is the anchor: zero, and constant however many reversals come.
/// New offsets may move p but never c, so the anchor takes up the difference.
///
/// As in the article, the anchor stays. The noise of the offsets then adds up in it, because each
/// inwards step in contact moves p and no outwards step moves it back. With a `recovery` above
/// zero (ours) the anchor returns to zero by at most that share of the reference's further travel;
/// until then the gain in contact is within `recovery` of 1.
///
/// What remains of a slack of width w is w / `free_gain`.
///
/// Wrong when the width is over-estimated: the tip overshoots by
/// max(0, estimated width (1 - 1 / `free_gain`) - true width).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compensator {
    free_gain: f64,
    gain_limit: f64,
    recovery: f64,
}

/// The state of a [`Compensator`]: the assumed play, reference and command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompensatorState {
    play: Play,
    tip: PlayState,
    reference: Option<f64>,
    command: f64,
    /// The command that the law proposed last; None if it is off the anchored law.
    proposed: Option<f64>,
    /// c - u beyond the law: 0 until `retune` moves p.
    pub(crate) anchor: f64,
}

impl CompensatorState {
    /// The state before the first reference, which sets the position nearest to zero.
    pub const fn new(play: Play) -> Self {
        Self {
            play,
            tip: PlayState { output: f64::NAN },
            reference: None,
            command: f64::NAN,
            proposed: None,
            anchor: 0.0,
        }
    }

    /// The play operator that the compensator inverts.
    pub const fn play(&self) -> Play {
        self.play
    }

    /// p = c - q, the position between the contacts; NaN before the first reference.
    pub fn position(&self) -> f64 {
        self.command - self.tip.output
    }

    /// The command c; NaN before the first reference.
    pub const fn command(&self) -> f64 {
        self.command
    }

    /// The predicted state q; NaN before the first reference.
    pub const fn predicted_state(&self) -> f64 {
        self.tip.output
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
            recovery: 0.0,
        })
    }

    /// This compensator with the anchor's return to zero, as a share of the reference's travel.
    ///
    /// # Errors
    /// The share is not at least 0 and below 1.
    pub fn with_recovery(self, recovery: f64) -> Result<Self, ConfigError> {
        let share = (0.0..1.0).contains(&recovery);
        require(share, "recovery", recovery, "at least 0, below 1")?;
        Ok(Self { recovery, ..self })
    }

    /// This compensator with a share of the free gain beyond 1: all of it with 1, no compensation with 0.
    #[must_use]
    pub(crate) const fn with_share(self, share: f64) -> Self {
        let free_gain = 1.0 + share * (self.free_gain - 1.0);
        Self { free_gain, ..self }
    }

    /// The command for the next reference.
    ///
    /// The first reference is passed through. A reference that has not changed, or is not
    /// finite, repeats the last command, bit for bit.
    pub fn step(&self, state: &mut CompensatorState, reference: f64) -> f64 {
        let command = self.propose(state, reference);
        self.commit(state, command);
        command
    }

    /// The command of [`Compensator::step`], which [`Compensator::commit`] adopts.
    pub(crate) fn propose(&self, state: &mut CompensatorState, reference: f64) -> f64 {
        let (command, is_anchored) = self
            .next_command(state, reference)
            .unwrap_or((state.command, true));
        state.proposed = is_anchored.then_some(command);
        command
    }

    /// Continues from the command that was sent, which may differ from the proposed one.
    pub(crate) fn commit(&self, state: &mut CompensatorState, command: f64) {
        state.command = command;
        if state.tip.output.is_nan() {
            state.tip.output = command - state.play.clamp(0.0);
        }
        state.play.step(&mut state.tip, command);
        let is_off = |proposed: f64| (command - proposed).abs() > 0.0;
        if state.proposed.is_none_or(is_off) {
            self.hold(state);
        }
    }

    /// The command of the law for the next reference, and whether it is on the anchored law; None where nothing moves.
    fn next_command(&self, state: &mut CompensatorState, reference: f64) -> Option<(f64, bool)> {
        if !reference.is_finite() {
            return None;
        }
        let Some(last) = state.reference.replace(reference) else {
            return Some((reference, false));
        };
        let increment = reference - last;
        if increment == 0.0 {
            return None;
        }
        let recovery = self.recovery * increment.abs();
        state.anchor -= state.anchor.max(-recovery).min(recovery);
        let origin = reference + state.anchor;
        let position = self.free_gain * (origin - state.tip.output);
        let command = origin + self.surplus() * state.play.clamp(position);

        // Rounding, and recovery on top of the gain, stay within Eq. (2) to the last bit.
        let farthest = state.command + self.gain_limit * increment;
        let allowed = command
            .max(state.command.min(farthest))
            .min(state.command.max(farthest));
        Some((allowed, (allowed - command).abs() == 0.0))
    }

    /// Changes the offsets, or continues with this compensator after another: bumpless.
    ///
    /// The command does not move. The position moves only as far as the new contacts require.
    pub fn retune(&self, state: &mut CompensatorState, play: Play) {
        state.play = play;
        if state.reference.is_some() {
            play.step(&mut state.tip, state.command);
            self.hold(state);
        }
    }

    /// Adds `shift` to the reference that the law counts from; the command does not move.
    pub(crate) fn shift_reference(&self, state: &mut CompensatorState, shift: f64) {
        if let Some(reference) = &mut state.reference {
            *reference += shift;
            self.hold(state);
        }
    }

    /// Sets the anchor such that the law gives the present command.
    fn hold(&self, state: &mut CompensatorState) {
        if let Some(reference) = state.reference {
            state.anchor = state.command - reference - self.surplus() * state.position();
        }
    }

    /// 1 - 1 / `free_gain`: the share of the position that the law adds to the reference.
    fn surplus(&self) -> f64 {
        1.0 - 1.0 / self.free_gain
    }
}
