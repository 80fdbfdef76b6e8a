//! What leaves the loop, whatever goes in.

use crate::supervision::command_limiter::{CommandLimiter, CommandLimits, LimiterResult};
use proptest::prelude::*;

use super::{config, support};

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -300.0..300.0, 1 => any::<f64>(), 1 => Just(f64::NAN)]
}

#[test]
fn settings_out_of_range_are_named() {
    let good = support::monitor(1.0);
    let cases = [
        (
            "gain_limit",
            CommandLimits {
                gain_limit: 0.9,
                ..good
            },
        ),
        (
            "command_speed",
            CommandLimits {
                step_limit: 0.0,
                ..good
            },
        ),
        (
            "lead_limit",
            CommandLimits {
                lead_limit: f64::NAN,
                ..good
            },
        ),
        (
            "travel",
            CommandLimits {
                travel: (1.0, 1.0),
                ..good
            },
        ),
        (
            "travel",
            CommandLimits {
                travel: (f64::NEG_INFINITY, 1.0),
                ..good
            },
        ),
    ];
    for (field, settings) in cases {
        assert_eq!(CommandLimiter::new(settings).unwrap_err().field, field);
    }
}

#[test]
fn each_limit_binds_and_a_broken_law_is_told_from_a_limit() {
    let start = || {
        let mut monitor = CommandLimiter::new(support::monitor(1.0)).unwrap();
        assert_eq!(monitor.permit(0.0, 0.0), (0.0, LimiterResult::Same));
        monitor
    };
    assert_eq!(start().permit(1.0, 5.0), (5.0, LimiterResult::Same));
    assert_eq!(start().permit(1.0, 5.1), (5.0, LimiterResult::Broken));
    assert_eq!(start().permit(1.0, -0.1), (0.0, LimiterResult::Broken));
    assert_eq!(start().permit(0.0, 1e-300), (0.0, LimiterResult::Broken));
    assert_eq!(start().permit(1.0, f64::NAN), (0.0, LimiterResult::Broken));
    assert_eq!(start().permit(-1.0, f64::NAN), (0.0, LimiterResult::Broken));
    for reference in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for command in [0.0, 1.0, f64::NAN] {
            let mut monitor = start();
            assert_eq!(
                monitor.permit(reference, command),
                (0.0, LimiterResult::Broken)
            );
            // And counts from the last that was one.
            assert_eq!(monitor.permit(1.0, 1.0), (1.0, LimiterResult::Same));
        }
    }
    assert_eq!(start().permit(2.0, 5.1), (0.0, LimiterResult::Jump));
    assert_eq!(start().permit(-2.0, -9.0), (0.0, LimiterResult::Jump));
    assert_eq!(start().permit(2.0, 10.1), (0.0, LimiterResult::Broken));
    let mut far = start();
    for step in 1..=200 {
        far.permit(f64::from(step), f64::from(step));
    }
    assert_eq!(far.permit(201.0, 201.0), (200.0, LimiterResult::Limited));
    let mut ahead = start();
    let mut command: f64 = 0.0;
    for step in 1..=20 {
        command = ahead.permit(f64::from(step), command + 5.0).0;
        assert!(command - f64::from(step) <= 30.0);
    }
    assert!((command - 50.0).abs() < 1e-12, "{command}");
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn what_leaves_keeps_the_law_and_what_keeps_it_passes(
        samples in prop::collection::vec((any_number(), any_number(), 0.0..5.0, any::<bool>()), 1..200)
    ) {
        let settings = support::monitor(1.0);
        let mut monitor = CommandLimiter::new(settings).unwrap();
        prop_assert_eq!(monitor.permit(1.0, 1.0), (1.0, LimiterResult::Same));
        let (mut reference, mut command) = (1.0, 1.0);
        for (next, wild, gain, lawful) in samples {
            // One step of the reference, or anything at all.
            let next: f64 = if lawful { reference + next.clamp(-1.0, 1.0) } else { next };
            let proposed = if lawful { command + gain * (next - reference) } else { wild };
            let (permitted, verdict) = monitor.permit(next, proposed);
            let du = if next.is_finite() { next - reference } else { 0.0 };
            let dc = permitted - command;
            let rounding = 8.0 * f64::EPSILON * (command.abs() + reference.abs() + 5.0 * du.abs());
            prop_assert!(permitted.is_finite());
            prop_assert!(dc * du >= 0.0 && dc.abs() <= 5.0 * du.abs() + rounding);
            prop_assert!(dc.abs() <= settings.step_limit + rounding);
            let (least, largest) = settings.travel;
            prop_assert!(permitted >= least.min(command) && permitted <= largest.max(command));
            prop_assert_eq!(verdict == LimiterResult::Same, permitted.to_bits() == proposed.to_bits() || permitted == proposed);
            command = permitted;
            if next.is_finite() {
                reference = next;
            }
        }
    }
}

#[test]
fn a_lead_that_is_limited_is_no_lost_motion_either_way() {
    for sign in [1.0, -1.0] {
        let mut monitor = CommandLimiter::new(support::monitor(1.0)).unwrap();
        monitor.permit(0.0, 0.0);
        for step in 1..=7 {
            let reference = sign * f64::from(step);
            let command = 5.0 * reference;
            assert_eq!(
                monitor.permit(reference, command),
                (command, LimiterResult::Same)
            );
        }
        assert_eq!(
            monitor.permit(sign * 8.0, sign * 40.0),
            (sign * 38.0, LimiterResult::Led)
        );
        assert_eq!(
            monitor.permit(sign * 9.0, sign * 43.0),
            (sign * 39.0, LimiterResult::Led)
        );
        assert_eq!(
            monitor.permit(sign * 8.0, sign * 34.0),
            (sign * 34.0, LimiterResult::Same)
        );
    }
}

#[test]
fn the_first_command_is_where_it_may_be_and_a_number() {
    let new = || CommandLimiter::new(support::monitor(1.0)).unwrap();
    for (reference, command) in [(f64::NAN, 0.0), (0.0, f64::NAN), (f64::INFINITY, 0.0)] {
        let (permitted, verdict) = new().permit(reference, command);
        assert!(permitted.is_nan());
        assert_eq!(verdict, LimiterResult::Broken);
    }
    assert_eq!(new().permit(190.0, 190.0), (190.0, LimiterResult::Same));
    assert_eq!(new().permit(190.0, 210.0), (200.0, LimiterResult::Limited));
    assert_eq!(
        new().permit(-90.0, -110.0),
        (-100.0, LimiterResult::Limited)
    );
}

#[test]
fn what_the_reference_is_shifted_by_is_no_motion_of_it() {
    for shift in [0.7, -0.7] {
        let mut monitor = CommandLimiter::new(support::monitor(1.0)).unwrap();
        monitor.permit(2.0, 3.0);
        monitor.shift(shift);
        assert_eq!(
            monitor.permit(2.0 + shift, 3.1),
            (3.0, LimiterResult::Broken)
        );
        assert_eq!(monitor.permit(2.1 + shift, 3.1), (3.1, LimiterResult::Same));
    }
}

/// At the end of the lead the command has to go with the reference, but no faster than a command may.
#[test]
fn a_lead_that_is_limited_moves_nothing_faster_than_it_may() {
    for sign in [1.0, -1.0] {
        let mut monitor = CommandLimiter::new(support::monitor(1.0)).unwrap();
        monitor.permit(0.0, sign * 30.0);
        let found = monitor.permit(-10.0 * sign, sign * 29.0);
        assert_eq!(found, (sign * 25.0, LimiterResult::Limited));
    }
}

/// A command that is out already comes back as it likes, and no farther out.
#[test]
fn from_beyond_a_limit_it_only_comes_back() {
    for sign in [1.0, -1.0] {
        let mut monitor = CommandLimiter::new(support::monitor(1.0)).unwrap();
        monitor.permit(0.0, sign * 40.0);
        let at = |reference: f64| sign * reference;
        // The lead of 40 is more than may be: it grows no farther, and shrinks.
        assert_eq!(
            monitor.permit(at(1.0), at(43.0)),
            (at(41.0), LimiterResult::Led)
        );
        assert_eq!(
            monitor.permit(at(2.0), at(41.5)),
            (at(41.5), LimiterResult::Same)
        );
        assert_eq!(
            monitor.permit(at(1.0), at(40.5)),
            (at(40.5), LimiterResult::Same)
        );
    }
}
