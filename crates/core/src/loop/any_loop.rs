//! Loops as objects, whose number of DOFs and profile are known at run time.

use crate::article::play::Play;
use crate::error::{ConfigError, require};
use crate::estimation::expectation::StatePrior;
use crate::estimation::history::Entry;
use crate::r#loop::profile::Profile;
use crate::r#loop::reduction::HysteresisReduction;
use crate::r#loop::report::{GeometryEstimate, Report, SlackEstimate};
use crate::supervision::flags::Flag;
use crate::supervision::supervisor::Supervision;

/// Most DOFs of a loop.
pub const DOFS: usize = 8;

/// A loop of n DOFs: slices have n entries, arrays n of `DOFS`.
pub trait Loop {
    /// Number of DOFs.
    fn dofs(&self) -> usize;

    /// Control tick, as [`HysteresisReduction::step`]: `command` (n,) for a reference (n,).
    fn step(&mut self, reference: &[f64], stamp: Option<f64>, time: f64, command: &mut [f64]) {
        self.step_within(reference, stamp, time, command, &mut |_, _| {});
    }

    /// As [`HysteresisReduction::step_within`]: `limit` has the last command and changes the next one.
    fn step_within(
        &mut self,
        reference: &[f64],
        stamp: Option<f64>,
        time: f64,
        command: &mut [f64],
        limit: &mut dyn FnMut(&[f64], &mut [f64]),
    );

    /// The reference that the law follows, behind the gate; NaN before the first.
    fn reference(&self) -> [f64; DOFS];

    /// The predicted state now.
    fn predicted_state(&self) -> [f64; DOFS];

    /// The estimated contact offsets.
    fn play(&self) -> [Play; DOFS];

    /// The estimated slack.
    fn slack(&self) -> SlackEstimate<DOFS>;

    /// State of the supervision.
    fn supervision(&self) -> Supervision;

    /// Use this share of the compensation: all with 1, none with 0. Bumpless: the command rests while the reference rests.
    ///
    /// # Errors
    /// The share is not from 0 to 1; the loop is unchanged.
    fn set_compensation(&mut self, share: f64) -> Result<(), ConfigError>;

    /// Re-engage the operator input: motion continues from rest, with the next increment of the reference.
    fn engage(&mut self);

    /// Acknowledge the warnings.
    fn acknowledge(&mut self);

    /// Raise a flag that only the rig can detect.
    fn raise(&mut self, flag: Flag);
}

/// A loop of the article's instrument.
pub trait BandLoop: Loop {
    /// Image update: the features (4,) in px measured in a frame captured at `captured_at` in s, and their
    /// covariance (4, 4) in px^2; None is 1 px^2 for each, or `marker_deviation` of profile `best`.
    ///
    /// Two NaN mark a band that was not found; None, or any other value that is not finite, means that no band was. A
    /// `checksum` of the pixels identifies a frozen image; without it, equal features do.
    fn on_features(
        &mut self,
        measured: Option<[f64; 4]>,
        covariance: Option<&[[f64; 4]; 4]>,
        captured_at: f64,
        checksum: Option<u64>,
    ) -> Report;

    /// The predicted state (3,) [m, rad, rad] at `captured_at` in s with its standard deviation: the prior of the marker
    /// detection, corrected by the last images.
    ///
    /// None beyond the history.
    fn predict_state(&self, captured_at: f64) -> Option<StatePrior>;

    /// Predicted features (4,) in px of a frame captured at `captured_at` in s.
    ///
    /// None beyond the history and where a band is not visible.
    fn predicted_features(&self, captured_at: f64) -> Option<[f64; 4]>;

    /// What images say of the geometry; None in profile `paper`.
    fn geometry(&self) -> Option<GeometryEstimate>;
}

impl<P: Profile<N>, S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>, V, const N: usize> Loop
    for HysteresisReduction<P, S, V, N>
{
    fn dofs(&self) -> usize {
        N
    }

    fn step_within(
        &mut self,
        reference: &[f64],
        stamp: Option<f64>,
        time: f64,
        command: &mut [f64],
        limit: &mut dyn FnMut(&[f64], &mut [f64]),
    ) {
        let mut taken = [f64::NAN; N];
        taken
            .iter_mut()
            .zip(reference)
            .for_each(|(to, of)| *to = *of);
        let next = Self::step_within(self, taken, stamp, time, |last, mut next| {
            limit(&last, &mut next);
            next
        });
        command.iter_mut().zip(next).for_each(|(to, of)| *to = of);
    }

    fn reference(&self) -> [f64; DOFS] {
        padded(self.monitors.reference(), f64::NAN)
    }

    fn predicted_state(&self) -> [f64; DOFS] {
        padded(Self::predicted_state(self), f64::NAN)
    }

    fn play(&self) -> [Play; DOFS] {
        padded(Self::play(self), Play::from_ordered(f64::NAN, f64::NAN))
    }

    fn slack(&self) -> SlackEstimate<DOFS> {
        let own = self.profile.slack_estimate();
        SlackEstimate {
            half_width: padded(own.half_width, f64::NAN),
            width_std: padded(own.width_std, f64::NAN),
            centre: padded(own.centre, f64::NAN),
            gain: padded(own.gain, f64::NAN),
            gain_std: padded(own.gain_std, f64::NAN),
        }
    }

    fn supervision(&self) -> Supervision {
        self.monitors.supervision()
    }

    fn set_compensation(&mut self, share: f64) -> Result<(), ConfigError> {
        let is_share = (0.0..=1.0).contains(&share);
        require(is_share, "compensation", share, "a share from 0 to 1")?;
        self.monitors.choose_share(&mut self.profile, share);
        Ok(())
    }

    fn engage(&mut self) {
        self.monitors.engage();
    }

    fn acknowledge(&mut self) {
        self.monitors.acknowledge();
    }

    fn raise(&mut self, flag: Flag) {
        self.monitors.raise(flag);
    }
}

/// The values of n DOFs as the first of `DOFS`.
pub(super) fn padded<T: Copy, const N: usize>(values: [T; N], fill: T) -> [T; DOFS] {
    let mut padded = [fill; DOFS];
    padded.iter_mut().zip(values).for_each(|(to, of)| *to = of);
    padded
}
