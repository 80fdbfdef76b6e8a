//! How much friction is shared: what offsets say of it, and what the loop makes of slacks that are apart.

use crate::adaptive::offset_map::Side;
use crate::adaptive::sharing::Sharing;
use crate::article::play::{Play, PlayState};
use crate::dof::PerDof;
use crate::r#loop::profile::Profile;
use crate::r#loop::report::Status;
use proptest::prelude::*;

use super::config;
use super::friction_step::slid;
use super::support::loops::{Loop, adaptive, adaptive_uncoupled, model};
use super::support::plays::{ThreePlays, WIDTH, reference};
use super::support::{PERIOD, UNITS};

/// After offsets of a slack about `middle`, `half` wide each way, whose other DOF takes `shared` of what it can.
fn told(middle: f64, half: f64, shared: f64, lost: &[f64]) -> f64 {
    let mut sharing = Sharing::new();
    for (index, lost) in lost.iter().enumerate() {
        let (side, sign) = if index % 2 == 0 {
            (Side::Plus, 1.0)
        } else {
            (Side::Minus, -1.0)
        };
        let offset = middle + sign * half * (1.0 - shared * lost);
        sharing.learn(side, *lost, offset, 0.01 * half * half);
    }
    sharing.shared()
}

proptest! {
    #![proptest_config(config())]

    /// By least squares all is all, nothing nothing, and 3/4 is found where all is expected.
    #[test]
    fn offsets_tell_how_much_is_shared(
        middle in -0.5..0.5, half in 1e-3..2.0, shared in 0.0..1.0, seed in prop::collection::vec(0.0..1.0, 40),
    ) {
        let lost: Vec<f64> = (0..800).map(|index| seed[index % 40]).collect();
        let spread = seed.iter().fold(0.0_f64, |most, value| most.max((value - seed[0]).abs()));
        prop_assume!(spread > 0.5);
        let found = told(middle * half, half, shared, &lost);
        let expected = (shared / 0.75).min(1.0);
        prop_assert!((found - expected).abs() < 0.08, "{found}, {expected}");
    }

    /// What is hardly ever lost says nothing.
    #[test]
    fn without_a_difference_it_stays(half in 1e-3..2.0, lost in 0.0..0.005) {
        prop_assert!(told(0.0, half, 0.0, &[lost; 500]) > 0.99);
    }

    /// Whatever comes in, it is a share, and it can be told anew.
    #[test]
    fn a_share_stays_a_share(
        offsets in prop::collection::vec((any::<bool>(), 0.0..=1.0, -1e300..1e300, 1e-300..1e300), 1..50),
    ) {
        let mut sharing = Sharing::new();
        for (upper, lost, offset, variance) in offsets {
            let side = if upper { Side::Plus } else { Side::Minus };
            sharing.learn(side, lost, offset, variance);
            prop_assert!((0.0..=1.0).contains(&sharing.shared()), "{sharing:?}");
        }
    }
}

/// A loop that expects one friction finds three plays apart as wide as they are, and believes what it sees of them.
#[test]
fn slacks_apart_are_learnt_as_they_are() {
    let (mut reduction, mut plays) = (adaptive(), ThreePlays::new());
    for tick in 0..60_000_u32 {
        let time = f64::from(tick) * PERIOD;
        plays.step(reduction.step(reference(time), None, time));
        if tick.is_multiple_of(8) {
            let report = reduction.on_features(plays.measure(), None, time, Some(u64::from(tick)));
            assert_ne!(report.status, Status::Refused, "{time} s: {report:?}");
            for (play, unit) in report.play.iter().zip(UNITS) {
                let off = (play.width() / (WIDTH * unit) - 1.0).abs();
                assert!(time < 60.0 || off < 0.1, "{time} s: {off}, {report:?}");
            }
        }
    }
}

/// An instrument whose insertion and rotation share one friction, and whose bending has its own.
struct Shaft {
    half: PerDof<f64>,
    n: [f64; 2],
    command: PerDof<f64>,
    bending: PlayState,
}

impl Shaft {
    fn new(command: PerDof<f64>) -> Self {
        Self {
            half: UNITS.map(|unit| 0.5 * WIDTH * unit),
            n: [0.0; 2],
            command,
            bending: PlayState { output: command[2] },
        }
    }

    fn follow(&mut self, command: PerDof<f64>) -> PerDof<f64> {
        let [h1, h2, h3] = self.half;
        let [along, around, bent] = command;
        let [n1, n2] = self.n;
        let pulled = [
            n1 + (along - self.command[0]) / h1,
            n2 + (around - self.command[1]) / h2,
        ];
        // The arm of the support's friction.
        self.n = slid(pulled, h1 / (1.75e-3 * h2));
        self.command = command;
        Play::new(-h3, h3).unwrap().step(&mut self.bending, bent);
        [
            along - self.n[0] * h1,
            around - self.n[1] * h2,
            self.bending.output,
        ]
    }
}

/// What the prediction of a loop that has learnt such an instrument is off without images, root mean square in [`UNITS`].
fn blindly_off<P: Profile>(mut reduction: Loop<P>) -> [f64; 2] {
    let mut shaft = Shaft::new(reference(0.0));
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    for tick in 0..20_000_u32 {
        let time = f64::from(tick) * PERIOD;
        let tip = shaft.follow(reduction.step(reference(time), None, time));
        if tick >= 15_000 {
            count += 1.0;
            let predicted = reduction.predicted_state();
            for (dof, sum) in sums.iter_mut().enumerate() {
                *sum += ((predicted[dof] - tip[dof]) / UNITS[dof]).powi(2);
            }
        } else if tick.is_multiple_of(8) {
            let features = model().predict(tip).map(|seen| seen.features);
            reduction.on_features(features, None, time, Some(u64::from(tick)));
        }
    }
    sums.map(|sum: f64| (sum / count).sqrt())
}

/// A loop that knows of one friction foresees the tip where there is one.
#[test]
fn one_friction_is_foreseen_by_who_expects_one() {
    let expects = blindly_off(adaptive());
    let without = blindly_off(adaptive_uncoupled());
    for (expects, without) in expects.iter().zip(without) {
        assert!(2.0 * expects < without, "{expects} {without}");
    }
}
