//! Any references, images and flags of the rig into the loop: it never panics, and its supervision stays consistent.
#![no_main]

#[path = "../../crates/core/tests/support/mod.rs"]
mod support;

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use support::loops::{Loop, article, best, model};
use support::{PERIOD, UNITS};
use tautscope_core::{BandLoop as _, BandProfile, Flag, Loop as _, Play, Reaction};

#[derive(Arbitrary, Debug)]
enum Action {
    /// The next control tick, with the reference moved by 1/64 of its units.
    Move([i8; 3]),
    /// An image of the predicted tip.
    Image {
        checksum: u64,
    },
    AnyStep {
        reference: [f64; 3],
        stamp: Option<f64>,
        time: f64,
    },
    AnyImage {
        features: Option<[f64; 4]>,
        captured_at: f64,
        checksum: Option<u64>,
    },
    Raise(u8),
    Engage,
    Acknowledge,
}

fuzz_target!(|input: (bool, Vec<Action>)| {
    let (is_best, actions) = input;
    if is_best {
        run(best(), actions);
    } else {
        let play = |unit| Play::new(-12.0 * unit, 12.0 * unit).unwrap();
        run(article(play), actions);
    }
});

fn run<P: BandProfile>(mut reduction: Loop<P>, actions: Vec<Action>) {
    let (mut now, mut reference) = (0.0, [0.025, 0.0, 0.9]);
    let mut last = reduction.step(reference, None, now);
    for action in actions {
        let was_held = reduction.supervision().reaction >= Reaction::HoldMotion;
        let mut command = last;
        match action {
            Action::Move(by) => {
                now += PERIOD;
                for ((value, by), unit) in reference.iter_mut().zip(by).zip(UNITS) {
                    *value += f64::from(by) / 64.0 * unit;
                }
                command = reduction.step(reference, None, now);
            }
            Action::AnyStep {
                reference,
                stamp,
                time,
            } => command = reduction.step(reference, stamp, time),
            Action::Image { checksum } => {
                let seen = model().predict(reduction.predicted_state());
                let features = seen.map(|seen| seen.features);
                reduction.on_features(features, None, now, Some(checksum));
            }
            Action::AnyImage {
                features,
                captured_at,
                checksum,
            } => {
                reduction.on_features(features, None, captured_at, checksum);
            }
            Action::Raise(number) => {
                let flag = Flag::ALL[usize::from(number) % Flag::ALL.len()];
                reduction.raise(flag);
                let supervision = reduction.supervision();
                assert!(supervision.flags.contains(flag));
            }
            Action::Engage => reduction.engage(),
            Action::Acknowledge => reduction.acknowledge(),
        }
        assert!(command.iter().all(|value| value.is_finite()));
        assert!(!was_held || command == last, "a held command rests");
        last = command;
        let supervision = reduction.supervision();
        assert!((0.0..=1.0).contains(&supervision.lead));
        let is_calm = supervision.reaction == Reaction::None;
        assert_eq!(supervision.flags.is_empty(), is_calm);
    }
}
