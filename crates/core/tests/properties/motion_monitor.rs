//! The motion monitor: what is a tremor, overcompensation or a limit cycle, and what is not.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::motion_monitor::MotionMonitor;
use crate::supervision::settings::SafetySettings;
use proptest::prelude::*;

use super::config;
use super::support::{PERIOD, UNITS, dofs, safety};

const UNIT: f64 = UNITS[0];
/// Control ticks from frame to frame.
const FRAME: u32 = 8;

fn new_monitor() -> MotionMonitor<3> {
    MotionMonitor::new(&safety(), &dofs(), PERIOD).unwrap()
}

fn along(value: f64) -> PerDof<f64> {
    [value, 0.0, 0.0]
}

fn none() -> PerDof<Play> {
    [Play::new(0.0, 0.0).unwrap(); 3]
}

/// All flags raised while reference and tip move for so many seconds.
fn raised(seconds: f64, reference: impl Fn(f64) -> f64, tip: impl Fn(f64) -> f64) -> Flags {
    let mut monitor = new_monitor();
    let mut all = Flags::NONE;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    for tick in 0..(seconds / PERIOD) as u32 {
        let time = f64::from(tick) * PERIOD;
        all = all.union(monitor.update_reference(along(reference(time))));
        if tick % FRAME == 0 {
            all = all.union(monitor.update_measurement(
                time,
                along(reference(time)),
                along(tip(time)),
                none(),
            ));
        }
    }
    all
}

fn sine(amplitude: f64, period: f64) -> impl Fn(f64) -> f64 {
    move |time| amplitude * (core::f64::consts::TAU * time / period).sin()
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_tip_that_follows_or_lags_raises_nothing(
        amplitude in 2.0..40.0_f64,
        period in 2.0..12.0_f64,
        slack in 0.0..25.0_f64,
        bias in -3.0..3.0_f64,
    ) {
        // A play operator, driven by its input.
        let reference = sine(amplitude * UNIT, period);
        let tip = core::cell::Cell::new(0.0_f64);
        let half = slack * UNIT / 2.0;
        let play = |time: f64| {
            let input = reference(time);
            tip.set(tip.get().max(input - half).min(input + half));
            tip.get() + bias * UNIT
        };
        prop_assert_eq!(raised(4.0 * period, &reference, play), Flags::NONE);
    }

    #[test]
    fn a_tip_that_overtakes_its_reference_after_a_turn_is_overcompensated(
        amplitude in 12.0..40.0_f64,
        period in 4.0..12.0_f64,
        over in 6.0..12.0_f64,
    ) {
        // After each turn the tip is five times as fast until it is ahead by `over`.
        let reference = sine(amplitude * UNIT, period);
        let last = core::cell::Cell::new((0.0_f64, 0.0_f64));
        let tip = |time: f64| {
            let now = reference(time);
            let (before, ahead) = last.get();
            let moved = now - before;
            let ahead = (ahead + 4.0 * moved).clamp(-over * UNIT, over * UNIT);
            last.set((now, ahead));
            now + ahead
        };
        let flags = raised(2.0 * period, &reference, tip);
        prop_assert_eq!(flags, Flags::of(Flag::Overcompensation));
    }
}

#[test]
fn an_offset_that_decreases_within_a_stroke_is_overcompensation() {
    for (shrunk, expected) in [(5.0, Flags::NONE), (7.0, Flags::of(Flag::Overcompensation))] {
        for sign in [1.0, -1.0] {
            let mut monitor = new_monitor();
            let mut all = Flags::NONE;
            for tick in 0..400_u32 {
                let time = f64::from(tick) * PERIOD;
                let reference = sign * 20.0 * UNIT * (4.0 * time).sin();
                // Well into the stroke back, the contact offset in use decreases.
                let now = if time > 0.8 { 12.0 - shrunk } else { 12.0 } * UNIT;
                let play = if sign > 0.0 {
                    Play::new(-now, 12.0 * UNIT).unwrap()
                } else {
                    Play::new(-12.0 * UNIT, now).unwrap()
                };
                let at = along(reference);
                all = all.union(monitor.update_measurement(time, at, at, [play; 3]));
                if time > 1.1 {
                    break;
                }
            }
            assert_eq!(all, expected, "{shrunk}, {sign}");
        }
    }
}

#[test]
fn a_tremor_is_four_reversals_a_second_or_more_within_the_slack() {
    let tremor = Flags::of(Flag::Tremor);
    for (amplitude, frequency, expected) in [
        (1.0, 6.0, tremor),
        (1.0, 12.0, tremor),
        (10.0, 3.0, tremor),
        (1.0, 1.0, Flags::NONE),
        (0.2, 10.0, Flags::NONE),
        (20.0, 4.0, Flags::NONE),
    ] {
        let mut monitor = new_monitor();
        let mut all = Flags::NONE;
        for tick in 0..1000 {
            let time = f64::from(tick) * PERIOD;
            let shake = amplitude * UNIT * (core::f64::consts::TAU * frequency * time).sin();
            all = all.union(monitor.update_reference(along(shake)));
        }
        assert_eq!(all, expected, "{amplitude} at {frequency} Hz");
    }
}

#[test]
fn a_tremor_that_reverses_no_moving_reference_is_seen_and_a_voluntary_motion_is_none() {
    let tremor = |time: f64| 0.6 * UNIT * (core::f64::consts::TAU * 8.0 * time).sin();
    let steady = |time: f64| 40.0 * UNIT * time;
    // Minimum-jerk moves to and fro, each over 20 units in 1 s.
    let voluntary = |time: f64| {
        let (count, s) = (time.floor(), time.fract());
        let moved = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
        20.0 * UNIT
            * if count % 2.0 == 0.0 {
                moved
            } else {
                1.0 - moved
            }
    };
    let increments = (0..400).map(|tick| f64::from(tick) * PERIOD);
    assert!(increments.clone().all(|time| {
        let next = time + PERIOD;
        steady(next) + tremor(next) > steady(time) + tremor(time)
    }));
    let both = |time: f64| steady(time) + tremor(time);
    assert_eq!(raised(2.0, both, steady), Flags::of(Flag::Tremor));
    assert_eq!(raised(2.0, steady, steady), Flags::NONE);
    assert_eq!(raised(10.0, voluntary, voluntary), Flags::NONE);
}

#[test]
fn the_steps_of_a_slow_or_coarse_input_device_are_no_tremor_but_a_tremor_in_them_is() {
    let voluntary = |time: f64| 20.0 * UNIT * (2.0 * time).sin();
    let tremor = |time: f64| UNIT * (core::f64::consts::TAU * 8.0 * time).sin();
    // Period of the device, in ticks, and its count.
    for (every, count) in [(4.0, 0.0), (10.0, 0.0), (1.0, 0.3), (1.0, 2.0), (4.0, 0.5)] {
        let given = |motion: &dyn Fn(f64) -> f64, time: f64| {
            let value = motion((time / (every * PERIOD) + 1e-9).floor() * every * PERIOD);
            if count > 0.0 {
                (value / (count * UNIT)).round() * count * UNIT
            } else {
                value
            }
        };
        let steps = |time: f64| given(&voluntary, time);
        assert_eq!(raised(10.0, steps, steps), Flags::NONE, "{every}, {count}");
        let both = |time: f64| given(&|at| voluntary(at) + tremor(at), time);
        assert_eq!(
            raised(2.0, both, steps),
            Flags::of(Flag::Tremor),
            "{every}, {count}"
        );
    }
}

/// An oscillation whose amplitude is so many times as large after each swing.
fn growing(growth: f64, period: f64) -> impl Fn(f64) -> f64 {
    move |time| {
        let swings = 2.0 * time / period;
        4.0 * UNIT * growth.powf(swings) * (core::f64::consts::PI * swings).sin()
    }
}

#[test]
fn swings_that_grow_together_are_a_limit_cycle() {
    let cycle = |growth, period| {
        let both = growing(growth, period);
        // Four turns that show five swings.
        raised(4.5 * period, &both, |time| 0.8 * both(time)).contains(Flag::LimitCycle)
    };
    assert!(cycle(1.2, 1.0) && cycle(1.3, 2.0));
    assert!(!cycle(1.0, 1.0), "it does not grow");
    assert!(!cycle(0.8, 1.0), "it dies out");
    assert!(!cycle(1.3, 5.0), "so slow an oscillation is intended");
    let input = growing(1.3, 1.0);
    let still = raised(4.5, &input, |_| 0.0);
    assert!(
        !still.contains(Flag::LimitCycle),
        "the tip takes no part in it"
    );
}

#[test]
fn a_tip_that_was_not_measured_raises_nothing() {
    let mut monitor = new_monitor();
    for tick in 0..400 {
        let time = f64::from(tick) * PERIOD;
        let found =
            monitor.update_measurement(time, along(sine(0.01, 1.0)(time)), [f64::NAN; 3], none());
        assert_eq!(found, Flags::NONE);
    }
}

#[test]
fn bad_settings_are_named() {
    type Change = fn(&mut SafetySettings);
    let changes: [(&str, Change); 9] = [
        ("tremor_swing", |s| s.tremor_swing = -1.0),
        ("width_limit", |s| s.width_limit[2] = f64::NAN),
        ("tremor_rate", |s| s.tremor_rate = 0.0),
        ("ahead_limit", |s| s.ahead_limit = f64::INFINITY),
        ("cycle_swings", |s| s.cycle_swings = 0),
        ("cycle_time", |s| s.cycle_time = 0.0),
        ("cycle_growth", |s| s.cycle_growth = -1.1),
        ("ahead_ratio", |s| s.ahead_ratio = 0.0),
        ("offset_decrease", |s| s.offset_decrease = f64::NAN),
    ];
    for (field, change) in changes {
        let mut wrong = safety();
        change(&mut wrong);
        let error = MotionMonitor::new(&wrong, &dofs(), PERIOD).unwrap_err();
        assert_eq!(error.field, field);
    }
    let error = MotionMonitor::new(&safety(), &dofs(), 0.0).unwrap_err();
    assert_eq!(error.field, "period");
}
