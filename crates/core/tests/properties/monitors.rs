//! What the monitors of the whole loop do about a hand, its device and its time.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::r#loop::reduction::HysteresisReduction;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::monitors::MonitorsSettings;
use crate::supervision::reactions::Reaction;
use crate::supervision::reference_gate::ReferenceGate;

use super::support::looped::{article, article_with};
use super::support::{self, PERIOD, UNITS, monitors};

#[test]
fn a_stall_throws_its_motion_away_and_stops_until_re_engaged() {
    let mut reduction = article(|unit| Play::new(-12.0 * unit, 12.0 * unit).unwrap());
    let (mut time, mut hand) = (0.0, 0.025);
    let mut last = reduction.step([hand, 0.0, 0.9], None, time);
    let mut tick = |reduction: &mut HysteresisReduction, dt: f64, move_by: f64| {
        time += dt;
        hand += move_by;
        let now = reduction.step([hand, 0.0, 0.9], None, time);
        let moved = now[0] - last[0];
        last = now;
        moved
    };
    let (still, step) = (0.0, 1e-4);
    assert!(tick(&mut reduction, PERIOD, step) > 0.0);
    assert_eq!(tick(&mut reduction, 4.0 * PERIOD, 7e-3), still);
    assert_eq!(reduction.monitors().supervision().reaction, Reaction::Warn);
    assert!(tick(&mut reduction, PERIOD, step) > 0.0);
    assert_eq!(tick(&mut reduction, 0.117, 7e-3), still);
    assert_eq!(
        reduction.monitors().supervision().reaction,
        Reaction::HoldMotion
    );
    assert_eq!(tick(&mut reduction, PERIOD, step), still);
    reduction.monitors_mut().engage();
    assert_eq!(tick(&mut reduction, 2.0, 0.0), still);
    let moved = tick(&mut reduction, PERIOD, step);
    assert!(moved > 0.0 && moved <= 5.0 * step * (1.0 + 1e-9), "{moved}");
}

const START: PerDof<f64> = [0.025, 0.0, 0.9];

fn begun() -> Box<HysteresisReduction> {
    let mut reduction = article(|_| Play::new(0.0, 0.0).unwrap());
    reduction.step(START, Some(0.0), 0.0);
    reduction
}

#[test]
fn a_reference_that_is_old_or_invalid_stops_motion() {
    for (hand, stamp) in [(0.0251, -0.06), (f64::NAN, 0.0)] {
        let mut reduction = begun();
        let command = reduction.step([hand, 0.0, 0.9], Some(stamp), PERIOD);
        assert_eq!(command, START);
        let reaction = reduction.monitors().supervision().reaction;
        assert_eq!(reaction, Reaction::HoldMotion, "{hand} of {stamp} s");
    }
}

#[test]
fn a_reference_that_is_too_fast_stops_motion() {
    let mut fast = begun();
    assert_eq!(fast.step([0.035, 0.0, 0.9], Some(0.0), PERIOD), START);
    assert!(fast.monitors().supervision().flags.has(Flag::ReferenceJump));
    assert_eq!(fast.monitors().supervision().reaction, Reaction::HoldMotion);
    fast.monitors_mut().engage();
    let [time, then] = [2.0 * PERIOD, 3.0 * PERIOD];
    assert_eq!(fast.step([0.035, 0.0, 0.9], Some(time), time), START);
    let [command, ..] = fast.step([0.0351, 0.0, 0.9], Some(then), then);
    let moved = command - 0.025;
    assert!((moved - 1e-4).abs() < 1e-12, "nothing catches up: {moved}");
}

/// The increments of a hand that gains `gain` in m/s with every tick, up to a speed in m/s.
fn runs_up(speed: f64, gain: f64) -> impl Iterator<Item = f64> {
    (1..2000).map(move |tick| speed.min(gain * f64::from(tick)) * PERIOD)
}

/// How far it comes before it is stopped, in m; None if it never is.
fn followed(speed: f64, gain: f64) -> Option<f64> {
    let mut clutch = ReferenceGate::new(support::clutch()).unwrap();
    let (mut time, mut hand, mut gone) = (0.0, 0.0, 0.0);
    clutch.admit([hand; 3], time, None, false, Flags::NONE);
    for increment in runs_up(speed, gain) {
        time += PERIOD;
        hand += increment;
        let admission = clutch.admit([hand, 0.0, 0.0], time, None, false, Flags::NONE);
        gone += admission.moved[0];
        if admission.raised.has(Flag::ReferenceJump) {
            assert_eq!(admission.moved, [0.0; 3]);
            return Some(gone);
        }
    }
    None
}

#[test]
fn a_hand_is_followed_at_its_speed_limit_and_a_faster_one_no_farther_than_the_law_says() {
    let settings = support::clutch();
    let (limit, over) = (settings.reference_speed[0], settings.reference_time);
    assert_eq!(followed(limit * (1.0 - 1e-9), limit), None);
    let steady = limit * PERIOD / -libm::expm1(-PERIOD / over);
    for ratio in [1.1, 1.5, 3.0, 10.0, 100.0] {
        let gone = followed(ratio * limit, limit).unwrap();
        let increments: Vec<f64> = runs_up(ratio * limit, limit).collect();
        let gained = |ticks: usize| -> f64 {
            let ages = (0_u32..).map(|ago| PERIOD / over * f64::from(ago));
            let last = increments[..=ticks].iter().rev().zip(ages);
            last.map(|(du, age)| du * (-age).exp()).sum()
        };
        let first = (0..increments.len())
            .find(|&ticks| gained(ticks) > steady)
            .unwrap();
        let most: f64 = increments[..first].iter().sum();
        assert!((gone - most).abs() <= 1e-9, "{ratio}: {gone} m, not {most}");
        assert!(ratio < 3.0 || gone <= 1.25 * steady, "{ratio}: {gone} m");
    }
}

#[test]
fn a_hand_that_is_faster_all_at_once_moves_nothing() {
    let settings = support::clutch();
    let limit = settings.reference_speed[0] + settings.reference_count[0] / PERIOD;
    assert_eq!(followed(1.001 * limit, f64::INFINITY), Some(0.0));
}

#[test]
fn a_device_that_was_silent_moves_nothing_until_re_engaged() {
    let settings = support::clutch();
    let speed = 0.5 * settings.reference_speed[0];
    for off in [Flags::NONE, Flags::of(Flag::ReferenceLate)] {
        let mut clutch = ReferenceGate::new(settings).unwrap();
        let mut held = false;
        let mut thrown = 0.0;
        for tick in 0..200 {
            let time = f64::from(tick) * PERIOD;
            // Longer than `reference_age`, and less than `reference_jump` would see.
            let said = if (100..115).contains(&tick) { 99 } else { tick };
            let hand = [speed * PERIOD * f64::from(said), 0.0, 0.0];
            let admission = clutch.admit(hand, time, None, held, off);
            if tick == 115 {
                assert_eq!(
                    admission.raised,
                    Flags::of(Flag::ReferenceLate).without(off)
                );
                held = !admission.raised.is_empty();
                thrown = if held {
                    8.0 * settings.reference_speed[0] * PERIOD
                } else {
                    0.0
                };
            } else {
                assert_eq!(admission.raised, Flags::NONE, "tick {tick}");
            }
            if tick == 150 && held {
                held = false;
                clutch.engage();
                thrown += speed * PERIOD * 36.0;
            }
        }
        let gone = clutch.admitted()[0];
        let hand = speed * PERIOD * 199.0;
        assert!(
            (hand - gone - thrown).abs() < 1e-12,
            "{hand} {gone} {thrown}"
        );
    }
}

#[test]
fn a_jump_that_nobody_saw_before_the_law_is_stopped_behind_it_and_moves_nothing() {
    for jump in [6.0, -6.0, 40.0] {
        let settings = MonitorsSettings {
            off: Flags::of(Flag::ReferenceJump),
            ..monitors()
        };
        let mut reduction = article_with(&settings, 0.0, |unit| {
            Play::new(-5.0 * unit, 5.0 * unit).unwrap()
        });
        let mut time = 0.0;
        let mut go = |reduction: &mut HysteresisReduction, at: f64| {
            time += PERIOD;
            reduction.step([at * UNITS[0], 0.0, 0.0], None, time)[0]
        };
        let before = (0..100)
            .map(|tick| go(&mut reduction, 0.1 * f64::from(tick)))
            .last()
            .unwrap();
        assert_eq!(reduction.monitors().supervision().reaction, Reaction::None);
        assert_eq!(go(&mut reduction, 9.9 + jump), before);
        assert!(
            reduction
                .monitors()
                .supervision()
                .flags
                .has(Flag::CommandJump)
        );
        assert_eq!(go(&mut reduction, 10.0), before, "nor does the way back");
        reduction.monitors_mut().engage();
        go(&mut reduction, 10.0);
        let moved = go(&mut reduction, 10.1) - before;
        assert!(
            (0.0..=0.5 * UNITS[0] * (1.0 + 1e-9)).contains(&moved),
            "{moved}"
        );
    }
}

#[test]
fn a_trembling_hand_is_no_fast_one() {
    let mut clutch = ReferenceGate::new(support::clutch()).unwrap();
    for tick in 0..4000 {
        let time = f64::from(tick) * PERIOD;
        let shake = 3e-3 * time.min(1.0) * (60.0 * time).sin();
        let admission = clutch.admit([shake, 0.0, 0.0], time, None, false, Flags::NONE);
        assert_eq!(admission.raised, Flags::NONE, "tick {tick}");
        assert_eq!(admission.reference, Some([shake, 0.0, 0.0]));
    }
}
