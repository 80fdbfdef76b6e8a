//! The start check: a tip that moves against its command is found, and no other one.

use crate::supervision::start_check::StartCheck;
use proptest::prelude::*;

use super::config;

/// Half of the expected slack.
const DEVIATION: f64 = 0.25;

/// Whether the check finds a tip behind slack `width` that moves by `gain` times its command, in sines of an amplitude, with noise.
fn is_found(width: f64, gain: f64, amplitude: f64, noise: &[f64]) -> bool {
    is_found_with(&[], width, gain, amplitude, noise)
}

/// The same with some measurements, by their number, replaced.
fn is_found_with(
    replaced: &[(u32, f64)],
    width: f64,
    gain: f64,
    amplitude: f64,
    noise: &[f64],
) -> bool {
    let mut check = StartCheck::new([DEVIATION]);
    let mut output: f64 = 0.0;
    let mut found = false;
    for (tick, noise) in (0_u32..).zip(noise.iter().cycle().take(1000)) {
        let command = amplitude * (f64::from(tick) / 100.0).sin();
        output = output.clamp(command - width / 2.0, command + width / 2.0);
        let other = replaced.iter().find(|(at, _)| *at == tick);
        let tip = other.map_or(3.0 + gain * output + noise, |(_, tip)| *tip);
        found |= check.update([command], [tip]);
    }
    found
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn only_a_tip_that_moves_against_its_command_is_found(
        width in 0.0..2.0 * DEVIATION,
        gain in 0.3_f64..3.0,
        amplitude in 3.0 * DEVIATION..20.0 * DEVIATION,
        noise in prop::collection::vec(-0.1 * DEVIATION..0.1 * DEVIATION, 97),
    ) {
        prop_assert!(!is_found(width, gain, amplitude, &noise));
        prop_assert!(is_found(width, -gain, amplitude, &noise));
    }

    #[test]
    fn what_a_tracker_gives_without_a_tool_hides_no_direction(
        width in 0.0..2.0 * DEVIATION,
        start in 0_u32..40,
        count in 1_u32..15,
        value in prop_oneof![Just(-9999.0), Just(-3.7e28), -500.0..-30.0],
        noise in prop::collection::vec(-0.1 * DEVIATION..0.1 * DEVIATION, 97),
    ) {
        let replaced: Vec<_> = (start..start + count).map(|at| (at, value)).collect();
        let amplitude = 4.0 * DEVIATION;
        prop_assert!(is_found_with(&replaced, width, -1.0, amplitude, &noise));
        prop_assert!(!is_found_with(&replaced, width, 1.0, amplitude, &noise));
    }

    #[test]
    fn noise_of_a_tip_that_rests_decides_nothing(
        noise in prop::collection::vec(-DEVIATION..DEVIATION, 97),
    ) {
        prop_assert!(!is_found(100.0, 1.0, 8.0 * DEVIATION, &noise));
    }
}

#[test]
fn it_begins_again_after_a_restart_and_a_dof_that_is_not_measured_waits() {
    let mut check = StartCheck::new([DEVIATION; 2]);
    let run = |check: &mut StartCheck<2>, sign: f64, other: f64| {
        (0_u32..100).any(|tick| {
            let command = f64::from(tick) * 0.1;
            check.update([command; 2], [sign * command, other * command])
        })
    };
    assert!(!run(&mut check, 1.0, f64::NAN));
    assert!(!run(&mut check, -1.0, 1.0));
    check.restart();
    assert!(run(&mut check, -1.0, 1.0));
    assert!(!run(&mut check, -1.0, -1.0));
}
