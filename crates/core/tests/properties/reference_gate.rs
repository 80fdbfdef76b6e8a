//! What comes of a hand's motion, and of its time.

use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reference_gate::{GatedReference, ReferenceGate, ReferenceGateSettings};
use proptest::prelude::*;

use super::config;
use super::support::{self, PERIOD, UNITS};

/// Ticks of a hand that moves all DOFs, in units.
struct Bench {
    clutch: ReferenceGate,
    time: f64,
    hand: f64,
}

impl Bench {
    fn new(hand: f64) -> Self {
        let mut bench = Self {
            clutch: ReferenceGate::new(support::clutch()).unwrap(),
            time: 0.0,
            hand,
        };
        let first = bench.to(hand, false);
        assert_eq!(first.reference, Some(UNITS.map(|unit| hand * unit)));
        assert_eq!(first.moved, [0.0; 3]);
        bench
    }

    fn to(&mut self, hand: f64, held: bool) -> GatedReference {
        (self.hand, self.time) = (hand, self.time + PERIOD);
        let reference = UNITS.map(|unit| hand * unit);
        self.clutch
            .admit(reference, self.time, None, held, Flags::NONE)
    }
}

#[derive(Debug, Clone, Copy)]
enum Tick {
    Moves(f64),
    Rests,
    Held(f64),
    Shifted(f64),
    Back,
}

fn ticks() -> impl Strategy<Value = Vec<Tick>> {
    let tick = prop_oneof![
        4 => (-0.3..0.3).prop_map(Tick::Moves),
        2 => Just(Tick::Rests),
        2 => (-0.3..0.3).prop_map(Tick::Held),
        1 => (-0.3..0.3).prop_map(Tick::Shifted),
        1 => Just(Tick::Back),
    ];
    prop::collection::vec(tick, 1..60)
}

proptest! {
    #![proptest_config(config())]

    /// What is admitted moves by what the hand does, wherever it was when it was let go on; at rest by nothing at all.
    #[test]
    fn it_moves_as_the_hand_does_and_with_it_rests_to_the_bit(start in -3.0..3.0, ticks in ticks()) {
        let mut bench = Bench::new(start);
        for tick in ticks {
            let (before, hand) = (bench.clutch.admitted(), bench.hand);
            let admission = match tick {
                Tick::Moves(by) => bench.to(hand + by, false),
                Tick::Rests => bench.to(hand, false),
                Tick::Held(by) => bench.to(hand + by, true),
                Tick::Shifted(by) => {
                    bench.clutch.shift([0.0, by * UNITS[1], 0.0]);
                    let shifted = bench.clutch.admitted();
                    prop_assert_eq!([shifted[0], shifted[2]], [before[0], before[2]]);
                    prop_assert!((shifted[1] - before[1] - by * UNITS[1]).abs() < 1e-12);
                    continue;
                }
                // To the other side of its own zero, as slowly as it takes.
                Tick::Back => {
                    if hand.abs() > 0.2 {
                        continue;
                    }
                    bench.to(-hand, false)
                }
            };
            prop_assert_eq!(admission.raised, Flags::NONE);
            let after = bench.clutch.admitted();
            prop_assert_eq!(admission.reference, Some(after));
            for dof in 0..3 {
                let moved = admission.moved[dof];
                prop_assert_eq!(moved, after[dof] - before[dof]);
                let by = match tick {
                    Tick::Moves(_) | Tick::Back => bench.hand - hand,
                    _ => 0.0,
                };
                if by == 0.0 {
                    prop_assert_eq!(moved, 0.0);
                } else {
                    prop_assert!((moved - by * UNITS[dof]).abs() < 1e-12, "{} for {}", moved, by);
                }
            }
        }
    }
}

fn admit(clutch: &mut ReferenceGate, hand: f64, time: f64, stamp: Option<f64>) -> GatedReference {
    clutch.admit([hand; 3], time, stamp, false, Flags::NONE)
}

/// A hand that has been at rest at 0 at time 0.
fn begun() -> ReferenceGate {
    begun_with(support::clutch())
}

fn begun_with(settings: ReferenceGateSettings) -> ReferenceGate {
    let mut clutch = ReferenceGate::new(settings).unwrap();
    assert!(clutch.admitted().iter().all(|value| value.is_nan()));
    assert_eq!(admit(&mut clutch, 0.0, 0.0, None).raised, Flags::NONE);
    clutch
}

#[test]
fn a_tick_is_late_beyond_three_periods_and_a_stall_beyond_its_time() {
    let late = Flags::of(Flag::LateTick);
    for (gap, raised, severe) in [
        (PERIOD, Flags::NONE, Flags::NONE),
        (3.0 * PERIOD, Flags::NONE, Flags::NONE),
        (3.001 * PERIOD, late, Flags::NONE),
        (0.1, late, Flags::NONE),
        (0.1001, late, late),
        (0.0, Flags::NONE, Flags::NONE),
        (-1e-9, Flags::of(Flag::Clock), Flags::NONE),
        (f64::NAN, Flags::of(Flag::Clock), Flags::NONE),
    ] {
        // The first tick has none before it.
        for start in [0.0, 4.0] {
            let mut clutch = ReferenceGate::new(support::clutch()).unwrap();
            let first = admit(&mut clutch, 0.0, start, None);
            assert_eq!((first.raised, first.severe), (Flags::NONE, Flags::NONE));
            if gap == 0.1 && start > 0.0 {
                continue;
            }
            let next = admit(&mut clutch, 1e-4, start + gap, None);
            // A clock that is no number cannot tell an age either.
            let found = (next.raised, next.severe);
            assert_eq!(found, (raised, severe), "{start} s and {gap} s");
            let moves = raised.is_empty();
            assert_eq!(next.moved[0] > 0.0, moves, "{start} s and {gap} s");
        }
    }
    let mut clutch = begun();
    clutch.engage();
    assert_eq!(admit(&mut clutch, 5.0, 9.0, None).raised, Flags::NONE);
    let stalled = admit(&mut clutch, 5.0, 19.0, None);
    assert_eq!((stalled.raised, stalled.severe), (late, late));
}

#[test]
fn a_reference_is_old_beyond_its_age_either_way() {
    let old = Flags::of(Flag::ReferenceLate);
    let age = support::clutch().reference_age;
    for (time, stamp, raised) in [
        (age, 0.0, Flags::NONE),
        (age, 2.0 * age, Flags::NONE),
        (8.0, 8.0 - 0.9 * age, Flags::NONE),
        (8.0, 8.0 - 1.1 * age, old),
        (8.0, 8.0 + 1.1 * age, old),
        (8.0, f64::NAN, old),
        (8.0, f64::INFINITY, old),
    ] {
        let mut clutch = begun();
        clutch.engage();
        let found = admit(&mut clutch, 0.0, time, Some(stamp));
        assert_eq!(found.raised, raised, "{stamp} s at {time} s");
    }
}

/// Nothing is looked at that is off, and nothing stops for it.
#[test]
fn what_is_off_stops_nothing() {
    for (flag, hand, time, stamp) in [
        (Flag::LateTick, 1e-4, 1.0, Some(1.0)),
        (Flag::ReferenceLate, 1e-4, PERIOD, Some(-1.0)),
        (Flag::ReferenceJump, 1.0, PERIOD, None),
        (Flag::Clock, 1e-4, -0.5, None),
    ] {
        for off in [Flags::NONE, Flags::of(flag)] {
            let mut clutch = begun();
            let found = clutch.admit([hand, 0.0, 0.0], time, stamp, false, off);
            assert_eq!(found.raised.has(flag), off.is_empty(), "{flag:?}");
            assert_eq!(found.moved[0] > 0.0, !off.is_empty(), "{flag:?}");
            assert_eq!(
                found.severe.is_empty(),
                !off.is_empty() || flag != Flag::LateTick
            );
        }
    }
}

/// Any one DOF may, and the least farther is too far.
#[test]
fn a_hand_may_gain_what_its_speed_limit_does_in_the_time_and_no_more() {
    // A step from rest is what the watch over the device looks at.
    let settings = ReferenceGateSettings {
        reference_count: [1e3; 3],
        ..support::clutch()
    };
    let ReferenceGateSettings {
        period,
        reference_speed,
        reference_time,
        ..
    } = settings;
    let steady = period / (1.0 - libm::exp(-period / reference_time));
    for dof in 0..3 {
        for (share, raised) in [(1.0, false), (1.0 + 1e-9, true), (-1.0 - 1e-9, true)] {
            let mut reference = [0.0; 3];
            reference[dof] = reference_speed[dof] * steady * share;
            let mut clutch = begun_with(settings);
            let found = clutch.admit(reference, PERIOD, None, false, Flags::NONE);
            assert_eq!(
                found.raised,
                Flags::when(raised, Flag::ReferenceJump),
                "{dof}, {share}"
            );
        }
    }
}

#[test]
fn what_is_no_number_is_not_admitted_nor_anything_while_held() {
    let invalid = Flags::of(Flag::ReferenceInvalid);
    let mut clutch = ReferenceGate::new(support::clutch()).unwrap();
    let wrong = admit(&mut clutch, f64::NAN, 0.0, None);
    assert_eq!((wrong.reference, wrong.raised), (None, invalid));
    let held = clutch.admit([0.5; 3], PERIOD, None, true, Flags::NONE);
    assert_eq!((held.reference, held.raised), (None, Flags::NONE));
    clutch.shift([1.0; 3]);
    let first = admit(&mut clutch, 0.3, 2.0 * PERIOD, None);
    assert_eq!(first.reference, Some([0.3; 3]));
    let wrong = admit(&mut clutch, f64::INFINITY, 3.0 * PERIOD, None);
    assert_eq!((wrong.reference, wrong.raised), (Some([0.3; 3]), invalid));
    assert_eq!(wrong.moved, [0.0; 3]);
    let unseen = clutch.admit(
        [f64::NAN; 3],
        4.0 * PERIOD,
        None,
        false,
        Flags::of(Flag::ReferenceInvalid),
    );
    assert_eq!(
        (unseen.reference, unseen.raised),
        (Some([0.3; 3]), Flags::NONE)
    );
    assert_eq!(clutch.admitted(), [0.3; 3]);
}

#[test]
fn settings_out_of_range_are_named() {
    type Change = fn(&mut ReferenceGateSettings);
    let changes: [(&str, Change); 7] = [
        ("period", |s| s.period = 0.0),
        ("reference_speed", |s| s.reference_speed[1] = 0.0),
        ("reference_time", |s| s.reference_time = f64::NAN),
        ("reference_age", |s| s.reference_age = -1.0),
        ("late_tick", |s| s.late_tick = 1.0),
        ("late_tick", |s| s.late_tick = f64::INFINITY),
        ("stall", |s| s.stall = 0.0),
    ];
    for (field, change) in changes {
        let mut wrong = support::clutch();
        change(&mut wrong);
        assert_eq!(ReferenceGate::new(wrong).unwrap_err().field, field);
    }
}
