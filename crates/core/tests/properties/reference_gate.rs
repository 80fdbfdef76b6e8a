//! The reference gate: motion, rest, holds and times of the reference.

use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reference_gate::{GatedReference, ReferenceGate};
use crate::supervision::settings::SafetySettings;
use proptest::prelude::*;

use super::config;
use super::support::{PERIOD, UNITS, dofs, safety};

/// A gate whose input moves all DOFs, in units.
struct Bench {
    gate: ReferenceGate<3>,
    time: f64,
    input: f64,
}

impl Bench {
    fn new(input: f64) -> Self {
        let mut bench = Self {
            gate: ReferenceGate::new(&safety(), &dofs(), PERIOD).unwrap(),
            time: 0.0,
            input,
        };
        let first = bench.to(input, false);
        assert_eq!(first.reference, Some(UNITS.map(|unit| input * unit)));
        assert_eq!(first.increments, [0.0; 3]);
        bench
    }

    fn to(&mut self, input: f64, is_held: bool) -> GatedReference<3> {
        (self.input, self.time) = (input, self.time + PERIOD);
        let reference = UNITS.map(|unit| input * unit);
        self.gate
            .step(reference, self.time, None, is_held, Flags::NONE)
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

    /// The output moves by what the input does, also after a hold, and rests to the bit while the input rests.
    #[test]
    fn the_output_moves_as_the_input_does_and_rests_to_the_bit_with_it(start in -3.0..3.0, ticks in ticks()) {
        let mut bench = Bench::new(start);
        for tick in ticks {
            let (before, input) = (bench.gate.reference(), bench.input);
            let gated = match tick {
                Tick::Moves(by) => bench.to(input + by, false),
                Tick::Rests => bench.to(input, false),
                Tick::Held(by) => bench.to(input + by, true),
                Tick::Shifted(by) => {
                    bench.gate.shift([0.0, by * UNITS[1], 0.0]);
                    let shifted = bench.gate.reference();
                    prop_assert_eq!([shifted[0], shifted[2]], [before[0], before[2]]);
                    prop_assert!((shifted[1] - before[1] - by * UNITS[1]).abs() < 1e-12);
                    continue;
                }
                // To the other side of its zero, slowly enough.
                Tick::Back => {
                    if input.abs() > 0.2 {
                        continue;
                    }
                    bench.to(-input, false)
                }
            };
            prop_assert_eq!(gated.raised, Flags::NONE);
            let after = bench.gate.reference();
            prop_assert_eq!(gated.reference, Some(after));
            for dof in 0..3 {
                let moved = gated.increments[dof];
                prop_assert_eq!(moved, after[dof] - before[dof]);
                let by = match tick {
                    Tick::Moves(_) | Tick::Back => bench.input - input,
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

fn step(
    gate: &mut ReferenceGate<3>,
    input: f64,
    time: f64,
    stamp: Option<f64>,
) -> GatedReference<3> {
    gate.step([input; 3], time, stamp, false, Flags::NONE)
}

/// A gate whose input was at 0 at time 0.
fn started() -> ReferenceGate<3> {
    started_with(&safety())
}

fn started_with(settings: &SafetySettings) -> ReferenceGate<3> {
    let mut gate = ReferenceGate::new(settings, &dofs(), PERIOD).unwrap();
    assert!(gate.reference().iter().all(|value| value.is_nan()));
    assert_eq!(step(&mut gate, 0.0, 0.0, None).raised, Flags::NONE);
    gate
}

#[test]
fn a_tick_is_late_after_three_periods_and_severe_after_the_stall_time() {
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
        // The first tick cannot be late.
        for start in [0.0, 4.0] {
            let mut gate = ReferenceGate::new(&safety(), &dofs(), PERIOD).unwrap();
            let first = step(&mut gate, 0.0, start, None);
            assert_eq!((first.raised, first.severe), (Flags::NONE, Flags::NONE));
            if gap == 0.1 && start > 0.0 {
                continue;
            }
            let next = step(&mut gate, 1e-4, start + gap, None);
            // With a time that is not finite there is no age either.
            let found = (next.raised, next.severe);
            assert_eq!(found, (raised, severe), "{start} s and {gap} s");
            let moves = raised.is_empty();
            assert_eq!(next.increments[0] > 0.0, moves, "{start} s and {gap} s");
        }
    }
    let mut gate = started();
    gate.engage();
    assert_eq!(step(&mut gate, 5.0, 9.0, None).raised, Flags::NONE);
    let stalled = step(&mut gate, 5.0, 19.0, None);
    assert_eq!((stalled.raised, stalled.severe), (late, late));
}

#[test]
fn a_reference_is_late_if_its_stamp_differs_by_more_than_its_age() {
    let old = Flags::of(Flag::ReferenceLate);
    let age = safety().reference_age;
    for (time, stamp, raised) in [
        (age, 0.0, Flags::NONE),
        (age, 2.0 * age, Flags::NONE),
        (8.0, 8.0 - 0.9 * age, Flags::NONE),
        (8.0, 8.0 - 1.1 * age, old),
        (8.0, 8.0 + 1.1 * age, old),
        (8.0, f64::NAN, old),
        (8.0, f64::INFINITY, old),
    ] {
        let mut gate = started();
        gate.engage();
        let found = step(&mut gate, 0.0, time, Some(stamp));
        assert_eq!(found.raised, raised, "{stamp} s at {time} s");
    }
}

#[test]
fn a_detector_that_is_off_raises_and_stops_nothing() {
    for (flag, input, time, stamp) in [
        (Flag::LateTick, 1e-4, 1.0, Some(1.0)),
        (Flag::ReferenceLate, 1e-4, PERIOD, Some(-1.0)),
        (Flag::ReferenceJump, 1.0, PERIOD, None),
        (Flag::Clock, 1e-4, -0.5, None),
    ] {
        for off in [Flags::NONE, Flags::of(flag)] {
            let mut gate = started();
            let found = gate.step([input, 0.0, 0.0], time, stamp, false, off);
            assert_eq!(found.raised.contains(flag), off.is_empty(), "{flag:?}");
            assert_eq!(found.increments[0] > 0.0, !off.is_empty(), "{flag:?}");
            assert_eq!(
                found.severe.is_empty(),
                !off.is_empty() || flag != Flag::LateTick
            );
        }
    }
}

#[test]
fn nothing_passes_that_is_not_finite_or_while_motion_is_held() {
    let invalid = Flags::of(Flag::ReferenceInvalid);
    let mut gate = ReferenceGate::new(&safety(), &dofs(), PERIOD).unwrap();
    let wrong = step(&mut gate, f64::NAN, 0.0, None);
    assert_eq!((wrong.reference, wrong.raised), (None, invalid));
    let held = gate.step([0.5; 3], PERIOD, None, true, Flags::NONE);
    assert_eq!((held.reference, held.raised), (None, Flags::NONE));
    gate.shift([1.0; 3]);
    let first = step(&mut gate, 0.3, 2.0 * PERIOD, None);
    assert_eq!(first.reference, Some([0.3; 3]));
    let wrong = step(&mut gate, f64::INFINITY, 3.0 * PERIOD, None);
    assert_eq!((wrong.reference, wrong.raised), (Some([0.3; 3]), invalid));
    assert_eq!(wrong.increments, [0.0; 3]);
    let unseen = gate.step(
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
    assert_eq!(gate.reference(), [0.3; 3]);
}

#[test]
fn settings_out_of_range_are_named() {
    type Change = fn(&mut SafetySettings);
    let changes: [(&str, Change); 8] = [
        ("reference_speed", |s| s.reference_speed[1] = 0.0),
        ("command_speed", |s| s.command_speed[2] = f64::NAN),
        ("reference_time", |s| s.reference_time = f64::NAN),
        ("reference_age", |s| s.reference_age = -1.0),
        ("late_tick", |s| s.late_tick = 1.0),
        ("late_tick", |s| s.late_tick = f64::INFINITY),
        ("stall", |s| s.stall = 1.9 * PERIOD),
        ("stall", |s| s.stall = f64::NAN),
    ];
    for (field, change) in changes {
        let mut wrong = safety();
        change(&mut wrong);
        assert_eq!(
            ReferenceGate::new(&wrong, &dofs(), PERIOD)
                .unwrap_err()
                .field,
            field
        );
    }
    let error = ReferenceGate::new(&safety(), &dofs(), 0.0).unwrap_err();
    assert_eq!(error.field, "period");
}
