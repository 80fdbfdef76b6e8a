//! The input device monitor: motions of an operator pass at any resolution and rate of the device, jumps after silence do not.

use std::f64::consts::TAU;

use crate::supervision::flags::{Flag, Flags};
use crate::supervision::input_device::InputDeviceMonitor;
use crate::supervision::settings::SafetySettings;
use proptest::prelude::*;

use super::config;
use super::support::{PERIOD, safety};

const SPEED: f64 = 0.04;
const COUNT: f64 = 50e-6;
const SILENCE: f64 = 0.05;

fn settings() -> SafetySettings {
    SafetySettings {
        reference_speed: [SPEED; 3],
        reference_count: [COUNT; 3],
        reference_age: SILENCE,
        ..safety()
    }
}

fn new_monitor() -> InputDeviceMonitor<3> {
    InputDeviceMonitor::new(&settings(), PERIOD).unwrap()
}

/// The flags of a device with these values, tick by tick, on one DOF.
fn raised(value: impl Fn(u32) -> f64, ticks: u32) -> Vec<(u32, Flags)> {
    let mut monitor = new_monitor();
    (1..ticks)
        .map(|tick| {
            let moved = [0.0, value(tick) - value(tick - 1), 0.0];
            (tick, monitor.update(moved, PERIOD))
        })
        .filter(|(_, raised)| !raised.is_empty())
        .collect()
}

/// The position of minimum-jerk strokes of `length` forth and back, with a rest after each.
fn strokes(time: f64, length: f64, takes: f64, rest: f64) -> f64 {
    let each = takes + rest;
    let s = ((time % each) / takes).min(1.0);
    let way = length * s.powi(3) * (10.0 + s * (6.0 * s - 15.0));
    if (time / each) % 2.0 < 1.0 {
        way
    } else {
        length - way
    }
}

proptest! {
    #![proptest_config(config())]

    /// Up to the largest speed, from rest to rest, in counts of 1 to 50 um, 33 to 200 times a second.
    #[test]
    fn an_input_that_moves_and_rests_passes(
        length in 0.1e-3..30e-3_f64,
        slower in 1.0..200.0,
        rest in 0.0..1.0,
        count in 1e-6..COUNT,
        each in 1_u32..=6,
    ) {
        // The peak speed is 1.875 d / D; no operator is faster than a fifth of a second.
        let takes = (1.875 * length / SPEED).max(0.2) * slower;
        let value = |tick: u32| {
            let time = f64::from(tick / each * each) * PERIOD;
            (strokes(time, length, takes, rest) / count).round() * count
        };
        let found = raised(value, 4000);
        prop_assert!(found.is_empty(), "{found:?}");
    }

    /// A steady motion during a silence of the device is detected, if it is more than the bound.
    #[test]
    fn a_device_that_was_silent_is_detected_at_its_next_value(
        speed in 1e-3..0.035,
        ticks in 11_u32..80,
        count in prop_oneof![Just(1e-9), 1e-6..20e-6_f64],
    ) {
        let value = |tick: u32| {
            let tick = if (100..100 + ticks).contains(&tick) { 99 } else { tick };
            let way: f64 = speed * f64::from(tick) * PERIOD;
            (way / count).round() * count
        };
        let step = value(100 + ticks) - value(99);
        prop_assume!((step - (SPEED * PERIOD + COUNT)).abs() > 1e-9);
        let is_detected = step > SPEED * PERIOD + COUNT;
        let expected = is_detected.then_some((100 + ticks, Flags::of(Flag::ReferenceLate)));
        let found = raised(value, 400);
        prop_assert_eq!(found, Vec::from_iter(expected));
    }

    /// A device whose values were delayed, and then are not.
    #[test]
    fn a_device_that_catches_up_is_detected(speed in -0.035..0.035_f64, late in 1_u32..100) {
        let value = |tick: u32| {
            let tick = if tick < 200 { tick } else { tick + late };
            speed * f64::from(tick) * PERIOD
        };
        let missed = (speed * f64::from(late) * PERIOD).abs();
        prop_assume!((missed - (SPEED * PERIOD + COUNT)).abs() > 1e-9);
        let found = raised(value, 400);
        if missed > SPEED * PERIOD + COUNT {
            prop_assert_eq!(found[0], (200, Flags::of(Flag::ReferenceJump)));
        } else {
            prop_assert!(found.is_empty(), "{found:?}");
        }
    }
}

#[test]
fn a_tremor_passes_until_it_is_larger_than_any_operators() {
    let trembles = |amplitude: f64| {
        // It builds up within a second.
        let value = |tick: u32| {
            let time = f64::from(tick) * PERIOD;
            amplitude * time.min(1.0) * (TAU * 12.0 * time).sin()
        };
        !raised(value, 800).is_empty()
    };
    assert!(!trembles(1e-3));
    assert!(trembles(3e-3));
}

#[test]
fn ticks_of_any_length_are_counted_as_long_as_they_were() {
    let mut monitor = new_monitor();
    for tick in 0..1000 {
        let gap = PERIOD * [0.6, 1.4, 1.0, 2.9][tick % 4];
        assert_eq!(monitor.update([SPEED * gap, 0.0, 0.0], gap), Flags::NONE);
    }
}

#[test]
fn without_a_valid_clock_a_tick_counts_as_one_period() {
    for gap in [0.0, -1.0, f64::NAN] {
        let mut monitor = new_monitor();
        for _ in 0..100 {
            assert_eq!(monitor.update([SPEED * PERIOD, 0.0, 0.0], gap), Flags::NONE);
        }
        for _ in 0..11 {
            monitor.update([0.0; 3], gap);
        }
        let raised = monitor.update([1.3 * SPEED * PERIOD, 0.0, 0.0], gap);
        assert_eq!(raised, Flags::of(Flag::ReferenceLate), "{gap}");
    }
}

#[test]
fn a_reset_forgets_the_motion_before() {
    let mut monitor = new_monitor();
    monitor.update([0.0; 3], 10.0);
    monitor.reset();
    let (slow, fast) = (0.22e-3, 0.3e-3);
    assert_eq!(
        monitor.update([fast, 0.0, 0.0], PERIOD),
        Flags::of(Flag::ReferenceJump)
    );
    assert_ne!(monitor.update([-slow, 0.0, 0.0], PERIOD), Flags::NONE);
    monitor.reset();
    assert_eq!(monitor.update([slow, 0.0, 0.0], PERIOD), Flags::NONE);
}

#[test]
fn limits_that_are_not_positive_are_refused() {
    type Change = fn(&mut SafetySettings, f64);
    assert!(InputDeviceMonitor::new(&settings(), PERIOD).is_ok());
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(InputDeviceMonitor::new(&settings(), bad).is_err());
        let changes: [Change; 3] = [
            |s, bad| s.reference_speed[1] = bad,
            |s, bad| s.reference_count[2] = bad,
            |s, bad| s.reference_age = bad,
        ];
        for change in changes {
            let mut wrong = settings();
            change(&mut wrong, bad);
            assert!(InputDeviceMonitor::new(&wrong, PERIOD).is_err(), "{bad}");
        }
    }
}

/// |du - v T| <= speed T + count and T <= silence, to the last bit: the numbers have few bits.
#[test]
fn a_value_on_a_bound_is_within() {
    let (period, speed, count) = (1.0 / 256.0, 1.0 / 32.0, 1.0 / 16384.0);
    let ticks = 16;
    let settings = SafetySettings {
        reference_speed: [speed; 3],
        reference_count: [count; 3],
        reference_age: f64::from(ticks) * period,
        ..safety()
    };
    let new = || InputDeviceMonitor::new(&settings, period).unwrap();
    for waited in [1, ticks / 2, ticks] {
        let bound = speed * f64::from(waited) * period + count;
        for (moved, expected) in [
            (bound, Flags::NONE),
            (-bound, Flags::NONE),
            (bound * (1.0 + 1e-12), Flags::of(Flag::ReferenceJump)),
        ] {
            let mut monitor = new();
            for _ in 1..waited {
                monitor.update([0.0; 3], period);
            }
            let raised = monitor.update([0.0, moved, 0.0], period);
            assert_eq!(raised, expected, "{moved} after {waited} ticks");
        }
    }
}
