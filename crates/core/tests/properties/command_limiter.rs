//! The command limiter: its output keeps the law for any input.

use crate::dof::Friction;
use crate::error::ConfigError;
use crate::supervision::command_limiter::{CommandLimiters, LimiterResult};
use crate::supervision::settings::SafetySettings;
use proptest::prelude::*;

use super::config;
use super::support::{PERIOD, safety_in};

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -300.0..300.0, 1 => any::<f64>(), 1 => Just(f64::NAN)]
}

fn settings() -> SafetySettings<1> {
    safety_in([1.0])
}

fn with(settings: &SafetySettings<1>, gain_limit: f64) -> Result<CommandLimiters<1>, ConfigError> {
    CommandLimiters::new(settings, [gain_limit], PERIOD, Friction::independent())
}

/// A limiter whose DOF moves by itself.
struct Single(CommandLimiters<1>);

impl Single {
    fn limit(&mut self, reference: f64, command: f64) -> (f64, LimiterResult) {
        let ([limited], [result]) = self.0.limit([reference], [command]);
        (limited, result)
    }
}

fn new_limiter() -> Single {
    Single(with(&settings(), 5.0).unwrap())
}

#[test]
fn settings_out_of_range_are_named() {
    type Change = fn(&mut SafetySettings<1>);
    let changes: [(&str, Change); 4] = [
        ("command_speed", |s| s.command_speed[0] = 0.0),
        ("width_limit", |s| s.width_limit[0] = f64::NAN),
        ("command_travel", |s| s.command_travel[0] = (1.0, 1.0)),
        ("command_travel", |s| {
            s.command_travel[0] = (f64::NEG_INFINITY, 1.0);
        }),
    ];
    for (field, change) in changes {
        let mut wrong = settings();
        change(&mut wrong);
        assert_eq!(with(&wrong, 5.0).unwrap_err().field, field);
    }
    assert_eq!(with(&settings(), 0.9).unwrap_err().field, "gain_limit");
}

#[test]
fn each_limit_binds_and_a_violation_of_the_law_differs_from_a_limit() {
    let start = || {
        let mut limiter = new_limiter();
        assert_eq!(limiter.limit(0.0, 0.0), (0.0, LimiterResult::Unchanged));
        limiter
    };
    assert_eq!(start().limit(1.0, 5.0), (5.0, LimiterResult::Unchanged));
    assert_eq!(start().limit(1.0, 5.1), (5.0, LimiterResult::Violation));
    assert_eq!(start().limit(1.0, -0.1), (0.0, LimiterResult::Violation));
    assert_eq!(start().limit(0.0, 1e-300), (0.0, LimiterResult::Violation));
    assert_eq!(
        start().limit(1.0, f64::NAN),
        (0.0, LimiterResult::Violation)
    );
    assert_eq!(
        start().limit(-1.0, f64::NAN),
        (0.0, LimiterResult::Violation)
    );
    for reference in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for command in [0.0, 1.0, f64::NAN] {
            let mut limiter = start();
            assert_eq!(
                limiter.limit(reference, command),
                (0.0, LimiterResult::Violation)
            );
            // The increment counts from the last reference that was finite.
            assert_eq!(limiter.limit(1.0, 1.0), (1.0, LimiterResult::Unchanged));
        }
    }
    assert_eq!(start().limit(2.0, 5.1), (0.0, LimiterResult::Jump));
    assert_eq!(start().limit(-2.0, -9.0), (0.0, LimiterResult::Jump));
    assert_eq!(start().limit(2.0, 10.1), (0.0, LimiterResult::Violation));
    let mut far = start();
    for step in 1..=200 {
        far.limit(f64::from(step), f64::from(step));
    }
    assert_eq!(far.limit(201.0, 201.0), (200.0, LimiterResult::Limited));
    let mut ahead = start();
    let mut command: f64 = 0.0;
    for step in 1..=20 {
        command = ahead.limit(f64::from(step), command + 5.0).0;
        assert!(command - f64::from(step) <= 30.0);
    }
    assert!((command - 50.0).abs() < 1e-12, "{command}");
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_output_keeps_the_law_and_a_command_that_keeps_it_passes(
        samples in prop::collection::vec((any_number(), any_number(), 0.0..5.0, any::<bool>()), 1..200)
    ) {
        let mut limiter = new_limiter();
        prop_assert_eq!(limiter.limit(1.0, 1.0), (1.0, LimiterResult::Unchanged));
        let (mut reference, mut command) = (1.0, 1.0);
        for (next, wild, gain, lawful) in samples {
            // A lawful step, or any numbers.
            let next: f64 = if lawful { reference + next.clamp(-1.0, 1.0) } else { next };
            let proposed = if lawful { command + gain * (next - reference) } else { wild };
            let (limited, result) = limiter.limit(next, proposed);
            let du = if next.is_finite() { next - reference } else { 0.0 };
            let dc = limited - command;
            let rounding = 8.0 * f64::EPSILON * (command.abs() + reference.abs() + 5.0 * du.abs());
            prop_assert!(limited.is_finite());
            prop_assert!(dc * du >= 0.0 && dc.abs() <= 5.0 * du.abs() + rounding);
            prop_assert!(dc.abs() <= 5.0 + rounding);
            prop_assert!(limited >= command.min(-100.0) && limited <= command.max(200.0));
            prop_assert_eq!(result == LimiterResult::Unchanged, limited.to_bits() == proposed.to_bits() || limited == proposed);
            command = limited;
            if next.is_finite() {
                reference = next;
            }
        }
    }
}

#[test]
fn a_limited_lead_loses_no_motion_in_either_direction() {
    for sign in [1.0, -1.0] {
        let mut limiter = new_limiter();
        limiter.limit(0.0, 0.0);
        for step in 1..=7 {
            let reference = sign * f64::from(step);
            let command = 5.0 * reference;
            assert_eq!(
                limiter.limit(reference, command),
                (command, LimiterResult::Unchanged)
            );
        }
        assert_eq!(
            limiter.limit(sign * 8.0, sign * 40.0),
            (sign * 38.0, LimiterResult::LeadLimited)
        );
        assert_eq!(
            limiter.limit(sign * 9.0, sign * 43.0),
            (sign * 39.0, LimiterResult::LeadLimited)
        );
        assert_eq!(
            limiter.limit(sign * 8.0, sign * 34.0),
            (sign * 34.0, LimiterResult::Unchanged)
        );
    }
}

#[test]
fn the_first_command_is_finite_and_within_the_travel() {
    for (reference, command) in [(f64::NAN, 0.0), (0.0, f64::NAN), (f64::INFINITY, 0.0)] {
        let (limited, result) = new_limiter().limit(reference, command);
        assert!(limited.is_nan());
        assert_eq!(result, LimiterResult::Violation);
    }
    assert_eq!(
        new_limiter().limit(190.0, 190.0),
        (190.0, LimiterResult::Unchanged)
    );
    assert_eq!(
        new_limiter().limit(190.0, 210.0),
        (200.0, LimiterResult::Limited)
    );
    assert_eq!(
        new_limiter().limit(-90.0, -110.0),
        (-100.0, LimiterResult::Limited)
    );
}

#[test]
fn a_shift_of_the_reference_is_no_motion() {
    for shift in [0.7, -0.7] {
        let mut limiter = new_limiter();
        limiter.limit(2.0, 3.0);
        limiter.0.shift_reference([shift]);
        assert_eq!(
            limiter.limit(2.0 + shift, 3.1),
            (3.0, LimiterResult::Violation)
        );
        assert_eq!(
            limiter.limit(2.1 + shift, 3.1),
            (3.1, LimiterResult::Unchanged)
        );
    }
}

/// At the limit of the lead the command moves with the reference, but no faster than `command_speed`.
#[test]
fn a_limited_lead_moves_the_command_no_faster_than_its_speed_limit() {
    for sign in [1.0, -1.0] {
        let mut limiter = new_limiter();
        limiter.limit(0.0, sign * 30.0);
        let found = limiter.limit(-10.0 * sign, sign * 29.0);
        assert_eq!(found, (sign * 25.0, LimiterResult::Limited));
    }
}

/// A command outside of a limit may return, and moves no farther out.
#[test]
fn a_command_outside_of_a_limit_only_returns() {
    for sign in [1.0, -1.0] {
        let mut limiter = new_limiter();
        limiter.limit(0.0, sign * 40.0);
        let at = |reference: f64| sign * reference;
        // The lead of 40 is above its limit: it may shrink, and does not grow.
        assert_eq!(
            limiter.limit(at(1.0), at(43.0)),
            (at(41.0), LimiterResult::LeadLimited)
        );
        assert_eq!(
            limiter.limit(at(2.0), at(41.5)),
            (at(41.5), LimiterResult::Unchanged)
        );
        assert_eq!(
            limiter.limit(at(1.0), at(40.5)),
            (at(40.5), LimiterResult::Unchanged)
        );
    }
}
