//! What a hand does passes, however its device counts and how often it speaks; what was not said does not.

use std::f64::consts::TAU;

use crate::supervision::flags::{Flag, Flags};
use crate::supervision::input_device::{InputDeviceMonitor, InputDeviceSettings};
use proptest::prelude::*;

use super::config;

const PERIOD: f64 = 0.005;
const SPEED: f64 = 0.04;
const COUNT: f64 = 50e-6;
const SILENCE: f64 = 0.05;

fn watch() -> InputDeviceMonitor {
    InputDeviceMonitor::new(InputDeviceSettings {
        period: PERIOD,
        speed: [SPEED; 3],
        count: [COUNT; 3],
        silence: SILENCE,
    })
    .unwrap()
}

/// What is raised of a device that says this, tick by tick, on one DOF.
fn raised(says: impl Fn(u32) -> f64, ticks: u32) -> Vec<(u32, Flags)> {
    let mut watch = watch();
    (1..ticks)
        .map(|tick| {
            let moved = [0.0, says(tick) - says(tick - 1), 0.0];
            (tick, watch.tick(moved, PERIOD))
        })
        .filter(|(_, raised)| !raised.is_empty())
        .collect()
}

/// Where minimum-jerk strokes of `length` forth and back, with a rest after each, bring a hand.
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

    /// At up to the largest speed, from rest and back to it, counted in 1 to 50 um, told 33 to 200 times a second.
    #[test]
    fn a_hand_that_moves_and_rests_passes(
        length in 0.1e-3..30e-3_f64,
        slower in 1.0..200.0,
        rest in 0.0..1.0,
        count in 1e-6..COUNT,
        each in 1_u32..=6,
    ) {
        // Peak speed 1.875 d / D; one that starts within a fifth of a second is none.
        let takes = (1.875 * length / SPEED).max(0.2) * slower;
        let says = |tick: u32| {
            let time = f64::from(tick / each * each) * PERIOD;
            (strokes(time, length, takes, rest) / count).round() * count
        };
        let found = raised(says, 4000);
        prop_assert!(found.is_empty(), "{found:?}");
    }

    /// Whatever a steady hand did while its device said nothing is silence, if it is more than the bound.
    #[test]
    fn a_device_that_was_silent_is_noticed_when_it_speaks(
        speed in 1e-3..0.035,
        ticks in 11_u32..80,
        count in prop_oneof![Just(1e-9), 1e-6..20e-6_f64],
    ) {
        let says = |tick: u32| {
            let tick = if (100..100 + ticks).contains(&tick) { 99 } else { tick };
            let way: f64 = speed * f64::from(tick) * PERIOD;
            (way / count).round() * count
        };
        let step = says(100 + ticks) - says(99);
        prop_assume!((step - (SPEED * PERIOD + COUNT)).abs() > 1e-9);
        let is_noticed = step > SPEED * PERIOD + COUNT;
        let expected = is_noticed.then_some((100 + ticks, Flags::of(Flag::ReferenceLate)));
        let found = raised(says, 400);
        prop_assert_eq!(found, Vec::from_iter(expected));
    }

    /// A device that told the past, and then the present.
    #[test]
    fn a_device_that_catches_up_is_noticed(speed in -0.035..0.035_f64, late in 1_u32..100) {
        let says = |tick: u32| {
            let tick = if tick < 200 { tick } else { tick + late };
            speed * f64::from(tick) * PERIOD
        };
        let missed = (speed * f64::from(late) * PERIOD).abs();
        prop_assume!((missed - (SPEED * PERIOD + COUNT)).abs() > 1e-9);
        let found = raised(says, 400);
        if missed > SPEED * PERIOD + COUNT {
            prop_assert_eq!(found[0], (200, Flags::of(Flag::ReferenceJump)));
        } else {
            prop_assert!(found.is_empty(), "{found:?}");
        }
    }
}

#[test]
fn a_tremor_passes_and_grows_into_what_no_hand_does() {
    let trembles = |amplitude: f64| {
        // Within a second, as a hand does.
        let says = |tick: u32| {
            let time = f64::from(tick) * PERIOD;
            amplitude * time.min(1.0) * (TAU * 12.0 * time).sin()
        };
        !raised(says, 800).is_empty()
    };
    assert!(!trembles(1e-3));
    assert!(trembles(3e-3));
}

#[test]
fn ticks_of_any_length_are_counted_as_long_as_they_were() {
    let mut watch = watch();
    for tick in 0..1000 {
        let gap = PERIOD * [0.6, 1.4, 1.0, 2.9][tick % 4];
        assert_eq!(watch.tick([SPEED * gap, 0.0, 0.0], gap), Flags::NONE);
    }
}

#[test]
fn a_clock_that_stands_still_or_is_none_counts_periods() {
    for gap in [0.0, -1.0, f64::NAN] {
        let mut watch = watch();
        for _ in 0..100 {
            assert_eq!(watch.tick([SPEED * PERIOD, 0.0, 0.0], gap), Flags::NONE);
        }
        for _ in 0..11 {
            watch.tick([0.0; 3], gap);
        }
        let raised = watch.tick([1.3 * SPEED * PERIOD, 0.0, 0.0], gap);
        assert_eq!(raised, Flags::of(Flag::ReferenceLate), "{gap}");
    }
}

#[test]
fn what_was_before_a_restart_is_forgotten() {
    let mut watch = watch();
    watch.tick([0.0; 3], 10.0);
    watch.restart();
    let (slow, fast) = (0.22e-3, 0.3e-3);
    assert_eq!(
        watch.tick([fast, 0.0, 0.0], PERIOD),
        Flags::of(Flag::ReferenceJump)
    );
    assert_ne!(watch.tick([-slow, 0.0, 0.0], PERIOD), Flags::NONE);
    watch.restart();
    assert_eq!(watch.tick([slow, 0.0, 0.0], PERIOD), Flags::NONE);
}

#[test]
fn what_is_no_limit_is_refused() {
    let good = InputDeviceSettings {
        period: PERIOD,
        speed: [SPEED; 3],
        count: [COUNT; 3],
        silence: SILENCE,
    };
    assert!(InputDeviceMonitor::new(good).is_ok());
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for settings in [
            InputDeviceSettings {
                period: bad,
                ..good
            },
            InputDeviceSettings {
                speed: [SPEED, bad, SPEED],
                ..good
            },
            InputDeviceSettings {
                count: [COUNT, COUNT, bad],
                ..good
            },
            InputDeviceSettings {
                silence: bad,
                ..good
            },
        ] {
            assert!(InputDeviceMonitor::new(settings).is_err(), "{settings:?}");
        }
    }
}

/// |du - v T| <= speed T + count where T <= silence: both to the last bit, in numbers of few bits.
#[test]
fn what_is_on_a_bound_is_within() {
    let (period, speed, count) = (1.0 / 256.0, 1.0 / 32.0, 1.0 / 16384.0);
    let ticks = 16;
    let new = || {
        InputDeviceMonitor::new(InputDeviceSettings {
            period,
            speed: [speed; 3],
            count: [count; 3],
            silence: f64::from(ticks) * period,
        })
        .unwrap()
    };
    for waited in [1, ticks / 2, ticks] {
        let bound = speed * f64::from(waited) * period + count;
        for (moved, expected) in [
            (bound, Flags::NONE),
            (-bound, Flags::NONE),
            (bound * (1.0 + 1e-12), Flags::of(Flag::ReferenceJump)),
        ] {
            let mut watch = new();
            for _ in 1..waited {
                watch.tick([0.0; 3], period);
            }
            let raised = watch.tick([0.0, moved, 0.0], period);
            assert_eq!(raised, expected, "{moved} after {waited} ticks");
        }
    }
}
