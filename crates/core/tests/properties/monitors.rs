//! The monitors in the loop: the operator's input, its device and its times.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::r#loop::any_loop::Loop as _;
use crate::r#loop::paper::Paper;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reactions::Reaction;
use crate::supervision::reference_gate::ReferenceGate;
use crate::supervision::settings::SafetySettings;

use super::support::loops::{Loop, article, article_with};
use super::support::{PERIOD, UNITS, dofs, safety};

#[test]
fn the_motion_of_a_stall_is_discarded_and_motion_stops_until_re_engaged() {
    let mut reduction = article(|unit| Play::new(-12.0 * unit, 12.0 * unit).unwrap());
    let (mut time, mut input) = (0.0, 0.025);
    let mut last = reduction.step([input, 0.0, 0.9], None, time);
    let mut tick = |reduction: &mut Loop<Paper>, dt: f64, move_by: f64| {
        time += dt;
        input += move_by;
        let now = reduction.step([input, 0.0, 0.9], None, time);
        let moved = now[0] - last[0];
        last = now;
        moved
    };
    let (still, step) = (0.0, 1e-4);
    assert!(tick(&mut reduction, PERIOD, step) > 0.0);
    assert_eq!(tick(&mut reduction, 4.0 * PERIOD, 7e-3), still);
    assert_eq!(reduction.supervision().reaction, Reaction::Warn);
    assert!(tick(&mut reduction, PERIOD, step) > 0.0);
    assert_eq!(tick(&mut reduction, 0.117, 7e-3), still);
    assert_eq!(reduction.supervision().reaction, Reaction::HoldMotion);
    assert_eq!(tick(&mut reduction, PERIOD, step), still);
    reduction.engage();
    assert_eq!(tick(&mut reduction, 2.0, 0.0), still);
    let moved = tick(&mut reduction, PERIOD, step);
    assert!(moved > 0.0 && moved <= 5.0 * step * (1.0 + 1e-9), "{moved}");
}

const START: PerDof<f64> = [0.025, 0.0, 0.9];

fn begun() -> Loop<Paper> {
    let mut reduction = article(|_| Play::new(0.0, 0.0).unwrap());
    reduction.step(START, Some(0.0), 0.0);
    reduction
}

#[test]
fn a_reference_that_is_old_or_invalid_stops_motion() {
    for (input, stamp) in [(0.0251, -0.06), (f64::NAN, 0.0)] {
        let mut reduction = begun();
        let command = reduction.step([input, 0.0, 0.9], Some(stamp), PERIOD);
        assert_eq!(command, START);
        let reaction = reduction.supervision().reaction;
        assert_eq!(reaction, Reaction::HoldMotion, "{input} of {stamp} s");
    }
}

#[test]
fn a_reference_that_jumps_stops_motion() {
    let mut fast = begun();
    assert_eq!(fast.step([0.035, 0.0, 0.9], Some(0.0), PERIOD), START);
    assert!(fast.supervision().flags.contains(Flag::ReferenceJump));
    assert_eq!(fast.supervision().reaction, Reaction::HoldMotion);
    fast.engage();
    let [time, then] = [2.0 * PERIOD, 3.0 * PERIOD];
    assert_eq!(fast.step([0.035, 0.0, 0.9], Some(time), time), START);
    let [command, ..] = fast.step([0.0351, 0.0, 0.9], Some(then), then);
    let moved = command - 0.025;
    assert!((moved - 1e-4).abs() < 1e-12, "nothing catches up: {moved}");
}

#[test]
fn a_device_that_was_silent_moves_nothing_until_re_engaged() {
    let settings = safety();
    let speed = 0.5 * settings.reference_speed[0];
    for off in [Flags::NONE, Flags::of(Flag::ReferenceLate)] {
        let mut gate = ReferenceGate::new(&settings, &dofs(), PERIOD).unwrap();
        let mut held = false;
        let mut discarded = 0.0;
        for tick in 0..200 {
            let time = f64::from(tick) * PERIOD;
            // Longer than `reference_age`, and less than `reference_jump` detects.
            let value = if (100..115).contains(&tick) { 99 } else { tick };
            let input = [speed * PERIOD * f64::from(value), 0.0, 0.0];
            let gated = gate.step(input, time, None, held, off);
            if tick == 115 {
                assert_eq!(gated.raised, Flags::of(Flag::ReferenceLate).difference(off));
                held = !gated.raised.is_empty();
                discarded = if held {
                    8.0 * settings.reference_speed[0] * PERIOD
                } else {
                    0.0
                };
            } else {
                assert_eq!(gated.raised, Flags::NONE, "tick {tick}");
            }
            if tick == 150 && held {
                held = false;
                gate.engage();
                discarded += speed * PERIOD * 36.0;
            }
        }
        let gone = gate.reference()[0];
        let input = speed * PERIOD * 199.0;
        assert!(
            (input - gone - discarded).abs() < 1e-12,
            "{input} {gone} {discarded}"
        );
    }
}

#[test]
fn a_jump_that_passes_the_gate_is_stopped_by_the_command_limiter_and_moves_nothing() {
    for jump in [6.0, -6.0, 40.0] {
        let settings = SafetySettings {
            off: Flags::of(Flag::ReferenceJump)
                .union(Flags::of(Flag::ReferenceFast))
                .union(Flags::of(Flag::Dropped)),
            ..safety()
        };
        let mut reduction = article_with(&settings, 0.0, |unit| {
            Play::new(-5.0 * unit, 5.0 * unit).unwrap()
        });
        let mut time = 0.0;
        let mut go = |reduction: &mut Loop<Paper>, at: f64| {
            time += PERIOD;
            reduction.step([at * UNITS[0], 0.0, 0.0], None, time)[0]
        };
        let before = (0..100)
            .map(|tick| go(&mut reduction, 0.1 * f64::from(tick)))
            .last()
            .unwrap();
        assert_eq!(reduction.supervision().reaction, Reaction::None);
        assert_eq!(go(&mut reduction, 9.9 + jump), before);
        assert!(reduction.supervision().flags.contains(Flag::CommandJump));
        assert_eq!(
            go(&mut reduction, 10.0),
            before,
            "the way back moves nothing either"
        );
        reduction.engage();
        go(&mut reduction, 10.0);
        let moved = go(&mut reduction, 10.1) - before;
        assert!(
            (0.0..=0.5 * UNITS[0] * (1.0 + 1e-9)).contains(&moved),
            "{moved}"
        );
    }
}
