//! The monitors in the loop: without a flag they change nothing, and each is called.

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::play::Play;
use crate::r#loop::any_loop::Loop as _;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reactions::Reaction;
use crate::supervision::settings::SafetySettings;

use super::support::loops::{article, article_with, best};
use super::support::{PERIOD, UNITS, safety};

/// While nothing is wrong, what the loop commands is what the law does by itself.
#[test]
fn supervision_changes_no_bit_of_a_nominal_run() {
    let play = |unit: f64| Play::new(-7.0 * unit, 11.0 * unit).unwrap();
    let mut reduction = article(play);
    let law = Compensator::new(5.0, 5.0).unwrap();
    let mut states = UNITS.map(|unit| CompensatorState::new(play(unit)));
    for tick in 0..20_000_u32 {
        let time = f64::from(tick) * PERIOD;
        let mut reference = UNITS;
        for (dof, value) in (0_u8..).zip(&mut reference) {
            let phase = time * (0.7 + 0.3 * f64::from(dof));
            *value *= 20.0 * phase.sin() + 9.0 * (2.3 * phase).cos();
        }
        let command = reduction.step(reference, None, time);
        for ((command, state), value) in command.iter().zip(&mut states).zip(reference) {
            assert_eq!(*command, law.step(state, value), "tick {tick}");
        }
    }
    assert_eq!(reduction.supervision().latched, Flags::NONE);
}

/// A first reference beyond the end of the travel is taken at the end, and no motion is lost but what was beyond.
#[test]
fn a_start_beyond_the_travel_begins_at_its_end() {
    for (minus, plus) in [(2.0, 6.0), (-6.0, -2.0), (-3.0, 3.0)] {
        let mut reduction = article(|unit| Play::new(minus * unit, plus * unit).unwrap());
        let unit = UNITS[0];
        let [command, ..] = reduction.step([210.0 * unit, 0.0, 0.0], None, 0.0);
        assert!((command / unit - 200.0).abs() < 1e-9);
        let [tip, ..] = reduction.predicted_state();
        let position = (command - tip) / unit;
        let nearest = 0.0_f64.clamp(minus, plus);
        assert!((position - nearest).abs() < 1e-9, "{position}");
        let mut last = command;
        for tick in 1..=400_u32 {
            let time = f64::from(tick) * PERIOD;
            let reference = 210.0 - 0.1 * f64::from(tick);
            let [command, ..] = reduction.step([reference * unit, 0.0, 0.0], None, time);
            assert!(command < last, "tick {tick}: {command} after {last}");
            last = command;
        }
        assert_eq!(reduction.supervision().flags, Flags::NONE, "it is over");
    }
}

/// The end of the travel is no jump of a command, and no fault of the law.
#[test]
fn the_end_of_the_travel_is_neither_a_jump_nor_a_violation() {
    let mut reduction = article(|_| Play::new(0.0, 0.0).unwrap());
    for tick in 0..3000_u32 {
        let time = f64::from(tick) * PERIOD;
        let reference = 230.0 * (0.4 * time).sin().max(0.0) * UNITS[0];
        reduction.step([reference, 0.0, 0.0], None, time);
        let supervision = reduction.supervision();
        assert!(supervision.reaction < Reaction::HoldMotion, "tick {tick}");
    }
    let latched = reduction.supervision().latched;
    assert_eq!(latched, Flags::of(Flag::Monitor));
}

#[test]
fn tremor_is_flagged_unless_its_detector_is_off() {
    for off in [Flags::NONE, Flags::of(Flag::Tremor)] {
        let settings = SafetySettings {
            off: off.union(Flags::of(Flag::Dropped)),
            ..safety()
        };
        let mut reduction = article_with(&settings, 0.0, |_| Play::new(0.0, 0.0).unwrap());
        for tick in 0..1000_u32 {
            let time = f64::from(tick) * PERIOD;
            let reference = UNITS[0] * (40.0 * time).sin();
            reduction.step([reference, 0.0, 0.0], None, time);
        }
        let latched = reduction.supervision().latched;
        assert_eq!(latched, Flags::of(Flag::Tremor).difference(off));
    }
}

#[test]
fn a_flag_of_the_rig_counts_unless_it_is_off() {
    for off in [Flags::NONE, Flags::of(Flag::FollowingError)] {
        let settings = SafetySettings { off, ..safety() };
        let mut reduction = article_with(&settings, 0.0, |_| Play::new(0.0, 0.0).unwrap());
        reduction.step([0.0; 3], None, 0.0);
        reduction.raise(Flag::FollowingError);
        let supervision = reduction.supervision();
        assert_eq!(
            supervision.flags,
            Flags::of(Flag::FollowingError).difference(off)
        );
        assert_eq!(supervision.reaction == Reaction::None, !off.is_empty());
    }
}

/// The square of such a motion is 0: an input behind a low-pass that settles at 0 ends with these.
#[test]
fn a_motion_too_small_to_square_is_rest() {
    for exponent in [-100, -150, -162, -163, -200, -300, -307] {
        for dof in 0..3 {
            let mut reduction = best();
            reduction.step([0.0; 3], None, 0.0);
            for tick in 1..100_u32 {
                let mut reference = [0.0; 3];
                reference[dof] = f64::from(tick % 3) * 10.0_f64.powi(exponent);
                let command = reduction.step(reference, None, f64::from(tick) * PERIOD);
                assert!(command[dof].abs() < 1e-90, "{command:?} at 1e{exponent}");
            }
            assert_eq!(reduction.supervision().reaction, Reaction::None);
        }
    }
}
