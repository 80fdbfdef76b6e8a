//! Eqs. (4)-(6).

use crate::article::estimator::{Estimator, EstimatorState, Trigger};
use crate::article::play::{Play, PlayState};
use proptest::prelude::*;

use super::{close, config, path, plays, turning_points};

const DISTANCE: f64 = 0.05;

fn estimator() -> Estimator {
    Estimator::new(DISTANCE, 0.4, 0.25).unwrap()
}

fn unknown() -> EstimatorState {
    EstimatorState::new(Play::new(0.0, 0.0).unwrap())
}

fn close_plays(a: Play, b: Play, tolerance: f64) -> bool {
    (a.delta_minus() - b.delta_minus()).abs() <= tolerance
        && (a.delta_plus() - b.delta_plus()).abs() <= tolerance
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn offsets_keep_their_order_and_stay_within_measured_values(
        first in plays(), signals in prop::collection::vec((-5.0..5.0, -5.0..5.0), 1..100)
    ) {
        let mut state = EstimatorState::new(first);
        let (mut least, mut most) = (first.delta_minus(), first.delta_plus());
        for (command, measured) in signals {
            estimator().update(&mut state, command, measured);
            let offset: f64 = command - measured;
            least = least.min(offset);
            most = most.max(offset);
            let play = state.play();
            prop_assert!(least <= play.delta_minus());
            prop_assert!(play.delta_minus() <= play.delta_plus());
            prop_assert!(play.delta_plus() <= most);
        }
    }

    #[test]
    fn the_true_offsets_are_a_fixed_point(truth in plays(), commands in turning_points()) {
        let mut state = EstimatorState::new(truth);
        let mut tip = PlayState { output: commands[0] - truth.delta_plus() };
        for command in path(&commands, 400) {
            estimator().update(&mut state, command, truth.step(&mut tip, command));
            prop_assert!(close_plays(state.play(), truth, 1e-12), "{:?}", state.play());
        }
    }

    #[test]
    fn estimate_converges_if_the_play_is_fully_crossed(truth in plays()) {
        let (mut state, mut tip) = (unknown(), PlayState { output: 0.0 });
        let commands: Vec<f64> = (0..6).map(|turn| if turn % 2 == 0 { -6.0 } else { 6.0 }).collect();
        for command in path(&commands, 600) {
            estimator().update(&mut state, command, truth.step(&mut tip, command));
        }
        prop_assert!(close_plays(state.play(), truth, 1e-6), "{:?} {truth:?}", state.play());
    }

    /// In steady contact the estimate depends on the distance travelled, not on the number of updates.
    #[test]
    fn estimate_does_not_depend_on_the_sample_rate(offset in 0.5..2.0, every in 1_u32..20) {
        let estimate = |stride: f64, updates: u32| {
            let mut state = unknown();
            for update in 0..=updates {
                let command = f64::from(update) * stride;
                estimator().update(&mut state, command, command - offset);
            }
            state.play().delta_plus()
        };
        let often = estimate(1.000_001 * DISTANCE, 20 * every);
        let seldom = estimate(f64::from(every) * 1.000_001 * DISTANCE, 20);
        prop_assert!((often - seldom).abs() <= 1e-9, "{} {}", often, seldom);
    }

    #[test]
    fn values_that_are_not_finite_are_ignored(
        command in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(1.0)],
        measured in prop_oneof![Just(f64::NAN), Just(f64::NEG_INFINITY)]
    ) {
        let mut state = unknown();
        estimator().update(&mut state, 0.0, 0.0);
        let before = state;
        prop_assert!(!estimator().update(&mut state, command, measured).any());
        prop_assert_eq!(state, before);
    }
}

#[test]
fn one_update_distance_applies_the_smoothing_factor() {
    let mut state = unknown();
    estimator().update(&mut state, 0.0, -1.0);
    estimator().update(&mut state, DISTANCE, DISTANCE - 1.0);
    assert!(close(state.play().delta_plus(), 0.25), "{state:?}");
}

#[test]
fn triggers_report_the_condition_and_prefer_contact() {
    let mut state = unknown();
    let rule = estimator();
    assert!(
        !rule.update(&mut state, 0.0, 0.0).any(),
        "the first pair is remembered"
    );
    assert!(
        !rule.update(&mut state, 0.9 * DISTANCE, 0.0).any(),
        "too near"
    );
    let stuck = rule.update(&mut state, 1.0, 0.0);
    assert_eq!((stuck.minus, stuck.plus), (None, Some(Trigger::Violation)));
    let follows = rule.update(&mut state, 2.0, 1.0);
    assert_eq!(
        (follows.minus, follows.plus),
        (None, Some(Trigger::Contact))
    );
    let back = rule.update(&mut state, 0.0, 1.0);
    assert_eq!((back.minus, back.plus), (Some(Trigger::Violation), None));
    let follows = rule.update(&mut state, -1.0, 0.0);
    assert_eq!(
        (follows.minus, follows.plus),
        (Some(Trigger::Contact), None)
    );
}

#[test]
fn reference_point_advances_if_no_condition_holds() {
    let mut state = EstimatorState::new(Play::new(-1.0, 1.0).unwrap());
    let rule = estimator();
    rule.update(&mut state, 0.0, 0.0);
    assert!(!rule.update(&mut state, 0.3, 0.0).any(), "free");
    assert!(
        rule.update(&mut state, 0.4, 0.1).plus.is_some(),
        "followed since"
    );
}

#[test]
fn bad_settings_are_named() {
    let field = |a, b, c| Estimator::new(a, b, c).unwrap_err().field;
    assert_eq!(field(0.0, 0.4, 0.25), "update_distance");
    assert_eq!(field(f64::NAN, 0.4, 0.25), "update_distance");
    assert_eq!(field(0.1, 1.0, 0.25), "contact_tolerance");
    assert_eq!(field(0.1, 0.4, 0.0), "smoothing_factor");
}

#[test]
fn contact_needs_equal_travel_within_the_tolerance() {
    for (followed, expected) in [(0.61, Some(Trigger::Contact)), (0.59, None)] {
        let mut state = EstimatorState::new(Play::new(-2.0, 2.0).unwrap());
        estimator().update(&mut state, 0.0, 0.0);
        let triggers = estimator().update(&mut state, 1.0, followed);
        assert_eq!((triggers.minus, triggers.plus), (None, expected));
    }
}

#[test]
fn exactly_at_a_bound_no_condition_holds() {
    let rule = Estimator::new(0.5, 0.5, 0.25).unwrap();
    // All numbers are exact in binary. The first pairs are half the tolerance apart, the others on an offset.
    for (command, measured) in [(1.0, 0.5), (-1.0, -0.5), (1.0, 0.0), (-1.0, 0.0)] {
        let mut state = EstimatorState::new(Play::new(-1.0, 1.0).unwrap());
        rule.update(&mut state, 0.0, 0.0);
        let triggers = rule.update(&mut state, command, measured);
        assert_eq!((triggers.minus, triggers.plus), (None, None));
        assert!(!triggers.any());
    }
}

#[test]
fn an_update_of_either_offset_is_an_update() {
    for command in [3.0, -3.0] {
        let mut state = EstimatorState::new(Play::new(-1.0, 1.0).unwrap());
        estimator().update(&mut state, 0.0, 0.0);
        assert!(estimator().update(&mut state, command, 0.0).any());
    }
}

#[test]
fn exactly_one_update_distance_is_enough() {
    let rule = Estimator::new(0.5, 0.5, 0.25).unwrap();
    let mut state = EstimatorState::new(Play::new(-0.25, 0.25).unwrap());
    rule.update(&mut state, 0.0, 0.0);
    assert!(rule.update(&mut state, 0.5, 0.0).any());
}

/// Eq. (6) from an offset of 1 to a measured one of 3, with a = 1/4 per distance: 1 + 2 a, and once more 1 + 2 (a + a (1 - a)).
#[test]
fn smoothing_starts_from_the_offset_before() {
    let rule = Estimator::new(0.5, 0.5, 0.25).unwrap();
    for (distances, expected) in [(1.0, 1.5), (2.0, 1.875)] {
        for side in [-1.0, 1.0] {
            let mut state = EstimatorState::new(Play::new(-1.0, 1.0).unwrap());
            let travel = 0.5 * distances;
            rule.update(&mut state, 0.0, side * (travel - 3.0));
            rule.update(&mut state, side * travel, side * (travel - 3.0));
            let (minus, plus) = (state.play().delta_minus(), state.play().delta_plus());
            let (used, other) = if side > 0.0 {
                (plus, minus)
            } else {
                (minus, plus)
            };
            assert!(close(used, side * expected), "{used}");
            assert_eq!(other, -side);
        }
    }
}
