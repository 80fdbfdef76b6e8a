//! Eqs. (2)-(3).

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::play::{Play, PlayState};
use proptest::prelude::*;

use super::{close, config, path, plays, turning_points};

#[derive(Debug, Clone)]
enum Event {
    Move(f64),
    Hold,
    Offsets(Play),
    Gain(f64, f64),
    Spoil(f64),
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let event = prop_oneof![
        4 => (-1.0..1.0).prop_map(Event::Move),
        1 => (-1e-15..1e-15).prop_map(Event::Move),
        1 => Just(Event::Hold),
        2 => plays().prop_map(Event::Offsets),
        1 => (1.0..5.0, 0.0..0.5).prop_map(|(gain, recovery)| Event::Gain(gain, recovery)),
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY)].prop_map(Event::Spoil),
    ];
    prop::collection::vec(event, 1..200)
}

pub(super) fn start(free_gain: f64, play: Play) -> (Compensator, CompensatorState) {
    (
        Compensator::new(free_gain, 5.0).unwrap(),
        CompensatorState::new(play),
    )
}

fn start_with_recovery(play: Play) -> (Compensator, CompensatorState) {
    let (compensator, state) = start(5.0, play);
    (compensator.with_recovery(0.1).unwrap(), state)
}

/// The output of a true play behind a compensator with an estimate of it.
fn tip_behind(compensator: &Compensator, estimated: Play, truth: Play, travel: &[f64]) -> Vec<f64> {
    let mut state = CompensatorState::new(estimated);
    let mut tip = PlayState { output: 0.0 };
    travel
        .iter()
        .map(|reference| truth.step(&mut tip, compensator.step(&mut state, *reference)))
        .collect()
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn gain_is_between_zero_and_its_limit_and_switching_is_bumpless(
        play in plays(), first in -5.0..5.0, events in events()
    ) {
        let (mut compensator, mut state) = start(5.0, play);
        let mut reference = first;
        prop_assert_eq!(compensator.step(&mut state, reference), reference);
        let (mut estimated, mut position) = (play, state.position());
        for event in events {
            let before = state.command();
            match event {
                Event::Move(increment) => {
                    let last = reference;
                    reference += increment;
                    let moved = compensator.step(&mut state, reference) - before;
                    let asked = reference - last;
                    let scale = before.abs().max(state.command().abs()).max(asked.abs());
                    position = estimated.clamp(position + moved);
                    prop_assert!(close(state.position(), position));
                    prop_assert!(moved * asked >= 0.0);
                    prop_assert!(moved.abs() <= 5.0 * asked.abs() + 4.0 * f64::EPSILON * scale);
                    continue;
                }
                Event::Hold => { compensator.step(&mut state, reference); }
                Event::Offsets(other) => {
                    estimated = other;
                    position = estimated.clamp(position);
                    compensator.retune(&mut state, estimated);
                }
                Event::Gain(gain, recovery) => {
                    compensator = Compensator::new(gain, 5.0).unwrap();
                    compensator = compensator.with_recovery(recovery).unwrap();
                    compensator.retune(&mut state, estimated);
                }
                Event::Spoil(bad) => { compensator.step(&mut state, bad); }
            }
            prop_assert_eq!(state.command().to_bits(), before.to_bits());
            let held = compensator.step(&mut state, reference);
            prop_assert_eq!(held.to_bits(), before.to_bits());
        }
    }

    #[test]
    fn predicted_state_is_the_play_of_the_command(
        gain in 1.0..5.0_f64, play in plays(), references in turning_points()
    ) {
        let (compensator, mut state) = start(gain, play);
        compensator.step(&mut state, references[0]);
        let mut tip = PlayState { output: state.predicted_state() };
        for reference in path(&references, 3) {
            let command = compensator.step(&mut state, reference);
            prop_assert!(close(play.step(&mut tip, command), state.predicted_state()));
        }
    }

    #[test]
    fn only_the_turning_points_matter(
        gain in 1.0..5.0_f64, play in plays(), references in turning_points()
    ) {
        let end = |steps| {
            let (compensator, mut state) = start(gain, play);
            let commands = path(&references, steps);
            commands.iter().map(|reference| compensator.step(&mut state, *reference)).last()
        };
        prop_assert!(close(end(1).unwrap(), end(17).unwrap()));
    }

    #[test]
    fn remaining_width_is_the_width_over_the_gain(gain in 1.0..5.0_f64, width in 0.1..3.0_f64) {
        let play = Play::new(-width, 0.0).unwrap();
        let compensator = Compensator::new(gain, 5.0).unwrap();
        let rest = width / gain;
        let tip = tip_behind(&compensator, play, play, &[0.0, 1.0, 1.0 - rest, -rest]);
        prop_assert!(close(tip[2], tip[1]), "held for width / gain: {:?}", tip);
        prop_assert!(close(tip[3], tip[1] - 1.0), "then followed: {:?}", tip);
    }

    #[test]
    fn overestimated_width_overshoots_by_the_formula(
        gain in 1.0..5.0_f64, true_width in 0.0..3.0_f64, estimated_width in 0.0..3.0_f64
    ) {
        let estimated = Play::new(-estimated_width, 0.0).unwrap();
        let truth = Play::new(-true_width, 0.0).unwrap();
        let compensator = Compensator::new(gain, 5.0).unwrap();
        let back = path(&[1.0, -4.0], 5000);
        let mut travel = vec![0.0];
        travel.extend(&back);
        let tip = tip_behind(&compensator, estimated, truth, &travel);
        let turned_at = tip[1];
        let overshoot = back.iter().zip(&tip[1..])
            .map(|(reference, tip)| (turned_at - tip) - (1.0 - reference))
            .fold(0.0, f64::max);
        let law = (estimated_width * (1.0 - 1.0 / gain) - true_width).max(0.0);
        prop_assert!((overshoot - law).abs() <= 5e-3, "{} against {}", overshoot, law);
    }
}

#[test]
fn nothing_drifts_over_a_hundred_thousand_reversals() {
    let play = Play::new(-0.004, 0.006).unwrap();
    let (compensator, mut state) = start(5.0, play);
    let invariant = |state: &CompensatorState, reference: f64| {
        state.command() - reference - (1.0 - 1.0 / 5.0) * state.position()
    };
    compensator.step(&mut state, 0.0);
    let at_start = invariant(&state, 0.0);
    for reversal in 0..100_000_u32 {
        let sign = if reversal % 2 == 0 { 1.0 } else { -1.0 };
        // Strides that never end a tick at a contact, at a tick rate that resolves them badly.
        for step in 1..=5_u32 {
            let depth = 0.02 + 0.003 * (f64::from(reversal) * 0.7).sin();
            let reference = sign * depth * (f64::from(step) / 2.5 - 1.0);
            compensator.step(&mut state, reference);
            let drift = invariant(&state, reference) - at_start;
            assert!(drift.abs() <= 1e-12, "{drift} after {reversal} reversals");
        }
    }
}

/// New offsets push the position inwards at either contact, never outwards. The law allows each
/// push; what it must not do is add them up.
#[test]
fn noise_of_the_offsets_does_not_accumulate_in_the_command() {
    let (compensator, mut state) = start_with_recovery(Play::new(-5.0, 5.0).unwrap());
    for tick in 0..400_000_u32 {
        let phase = f64::from(tick);
        if tick % 8 == 0 {
            let noise = 0.02 * (phase * 1.7).sin();
            let play = Play::new(-5.0 + 0.2 * noise, 5.0 + noise).unwrap();
            compensator.retune(&mut state, play);
        }
        compensator.step(&mut state, 15.0 * (phase / 500.0).sin());
        assert!(state.anchor.abs() < 0.1, "{} in tick {tick}", state.anchor);
    }
}

/// Eq. (2) to the letter: whatever was estimated before, K is 1 in contact.
#[test]
fn without_recovery_the_gain_in_contact_is_one() {
    let (compensator, mut state) = start(5.0, Play::new(-2.0, 2.0).unwrap());
    for reference in path(&[0.0, 10.0], 100) {
        compensator.step(&mut state, reference);
    }
    compensator.retune(&mut state, Play::new(-2.0, 1.0).unwrap());
    for reference in path(&[10.0, 17.0], 100).split_off(1) {
        let (before, command) = (state.command(), compensator.step(&mut state, reference));
        assert!(close(command - before, 0.07), "{}", command - before);
    }
    assert!(close(state.anchor, 0.8), "{}", state.anchor);
}

#[test]
fn anchor_returns_to_zero_with_a_bounded_gain() {
    let (compensator, mut state) = start_with_recovery(Play::new(-2.0, 2.0).unwrap());
    for reference in path(&[0.0, 10.0], 100) {
        compensator.step(&mut state, reference);
    }
    compensator.retune(&mut state, Play::new(-2.0, 1.0).unwrap());
    assert!(close(state.anchor, 0.8), "{}", state.anchor);
    for reference in path(&[10.0, 17.0], 100).split_off(1) {
        let (before, command) = (state.command(), compensator.step(&mut state, reference));
        let gain = (command - before) / 0.07;
        assert!((0.899..1.001).contains(&gain), "{gain}");
    }
    assert!(close(state.anchor, 0.1), "{}", state.anchor);
    compensator.step(&mut state, 19.0);
    assert_eq!(state.anchor, 0.0);
}

#[test]
fn bad_gains_are_named() {
    assert_eq!(Compensator::new(0.9, 5.0).unwrap_err().field, "free_gain");
    assert_eq!(Compensator::new(6.0, 5.0).unwrap_err().field, "free_gain");
    assert_eq!(
        Compensator::new(f64::NAN, 5.0).unwrap_err().field,
        "free_gain"
    );
    let compensator = Compensator::new(2.0, 5.0).unwrap();
    for share in [-0.1, 1.0, f64::NAN] {
        assert_eq!(
            compensator.with_recovery(share).unwrap_err().field,
            "recovery"
        );
    }
    assert_eq!(
        Compensator::new(2.0, f64::INFINITY).unwrap_err().field,
        "gain_limit"
    );
}

#[test]
fn holding_the_reference_keeps_even_the_sign_of_zero() {
    let (compensator, mut state) = start(5.0, Play::new(0.0, 1.0).unwrap());
    compensator.step(&mut state, -0.0);
    let held = compensator.step(&mut state, -0.0);
    assert_eq!(held.to_bits(), (-0.0_f64).to_bits());
}

/// Where the gain limit leaves no room for it, recovery is given up, not saved for the contact.
#[test]
fn recovery_never_makes_a_jump_at_the_contact() {
    let (compensator, mut state) = start_with_recovery(Play::new(-2.0, 2.0).unwrap());
    for reference in path(&[0.0, -10.0], 100) {
        compensator.step(&mut state, reference);
    }
    compensator.retune(&mut state, Play::new(-1.0, 2.0).unwrap());
    assert!(close(state.anchor, -0.8), "{}", state.anchor);
    let mut was_in_contact = false;
    for reference in path(&[-10.0, -5.0], 500).split_off(1) {
        let (before, command) = (state.command(), compensator.step(&mut state, reference));
        let gain = (command - before) / 0.01;
        assert!(
            gain <= if was_in_contact { 1.1 } else { 5.0 } + 1e-9,
            "{gain}"
        );
        was_in_contact = state.position() >= 2.0 - 1e-9;
    }
    assert!(was_in_contact);
}
