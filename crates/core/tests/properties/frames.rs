//! The frame gate: times, images and innovations of frames.

use crate::dof::PerDof;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::frame_gate::{FrameArrival, FrameGate, ImageIdentity};
use crate::supervision::repeat::Repeat;
use crate::supervision::settings::SafetySettings;
use proptest::prelude::*;

use super::config;
use super::support::{UNITS, dofs, safety};

fn new_gate() -> FrameGate<3> {
    FrameGate::new(&safety(), &dofs()).unwrap()
}

proptest! {
    #![proptest_config(config())]

    /// Counted from the first image that is repeated, in each DOF.
    #[test]
    fn an_image_that_is_repeated_after_motion_is_frozen(
        dof in 0..3_usize, ways in prop::collection::vec(0.0..0.7, 1..8), known in prop::bool::ANY,
    ) {
        let mut gate = new_gate();
        let mut travel = UNITS.map(|limit| 3.7 * limit);
        let mut arrive = |image: Option<ImageIdentity>, travel: Option<PerDof<f64>>| {
            gate.check_arrival(&FrameArrival { captured_at: 1.0, now: 1.0, image, is_stuck: false, travel })
        };
        let [first, other] = if known {
            [ImageIdentity::Checksum(7), ImageIdentity::Checksum(8)]
        } else {
            [ImageIdentity::Features([1, 2, 3, 4]), ImageIdentity::Features([1, 2, 3, 5])]
        };
        let mut gone = 0.0;
        prop_assert_eq!(arrive(Some(first), Some(travel)), Flags::NONE);
        for way in ways {
            gone += way;
            travel[dof] += way * UNITS[dof];
            prop_assume!(f64::abs(gone - 1.0) > 1e-9);
            prop_assert_eq!(arrive(Some(first), Some(travel)), Flags::when(gone > 1.0, Flag::Frozen));
            prop_assert_eq!(arrive(None, Some(travel)), Flags::NONE);
            prop_assert_eq!(arrive(Some(first), None), Flags::NONE);
        }
        prop_assert_eq!(arrive(Some(other), Some(travel)), Flags::NONE);
        prop_assert_eq!(arrive(Some(first), Some(travel)), Flags::NONE);
    }
}

/// Farther than any slack from the command since when it repeats, until it changes.
#[test]
fn a_value_is_stuck_once_the_command_would_have_changed_it() {
    let (mut repeat, limit) = (Repeat::<2>::NEW, 1.5);
    let mut is_stuck = |value: f64, command: [f64; 2]| {
        repeat.update(value, command, |from| (command[0] - from[0]).abs() > limit)
    };
    for _ in 0..10 {
        for command in [[0.0; 2], [-1.4, 9.0], [1.4, -9.0]] {
            assert!(!is_stuck(0.1, command), "{command:?}");
        }
    }
    assert!(is_stuck(0.1, [1.6, 0.0]));
    assert!(is_stuck(0.1, [0.0, 0.0]), "it has not moved since");
    assert!(!is_stuck(0.2, [0.0, 0.0]));
    assert!(!is_stuck(0.2, [1.4, 0.0]));
    assert!(is_stuck(0.2, [-1.6, 0.0]));
}

/// The flags of a frame's times.
fn arrive(gate: &mut FrameGate<3>, captured_at: f64, now: f64, is_in_history: bool) -> Flags {
    let travel = is_in_history.then_some([0.0; 3]);
    gate.check_arrival(&FrameArrival {
        captured_at,
        now,
        image: None,
        is_stuck: false,
        travel,
    })
}

#[test]
fn a_frame_is_late_after_its_age_and_dropped_after_the_gap() {
    let SafetySettings {
        frame_age,
        frame_gap,
        ..
    } = safety();
    let late = Flags::of(Flag::Late);
    for start in [0.0, 5.0] {
        let mut gate = new_gate();
        assert_eq!(
            gate.check_gap(start + 100.0),
            Flags::NONE,
            "no frame to miss yet"
        );
        assert_eq!(arrive(&mut gate, start, start, true), Flags::NONE);
        for (gap, missed) in [(0.5, false), (0.999, false), (1.001, true), (3.0, true)] {
            let flags = gate.check_gap(start + gap * frame_gap);
            assert_eq!(flags, Flags::when(missed, Flag::Dropped), "{gap}");
        }
        let now = start + 10.0;
        assert_eq!(
            arrive(&mut gate, now - 0.999 * frame_age, now, true),
            Flags::NONE
        );
        assert_eq!(arrive(&mut gate, now - 1.001 * frame_age, now, true), late);
        assert_eq!(arrive(&mut gate, now - 2.0 * frame_age, now, true), late);
        assert_eq!(gate.check_gap(now), Flags::NONE, "late, but not missing");
        assert_eq!(
            arrive(&mut gate, now, f64::NAN, true),
            Flags::NONE,
            "the control tick reports it"
        );
        assert_eq!(gate.check_gap(now), Flags::NONE);
    }
    // A clock that is set back does not hide that frames are missing.
    let mut gate = new_gate();
    arrive(&mut gate, 1000.0, 1000.0, true);
    assert_eq!(gate.check_gap(5.0), Flags::NONE);
    let missed = gate.check_gap(5.0 + 1.001 * frame_gap);
    assert_eq!(missed, Flags::of(Flag::Dropped));
    let mut gate = new_gate();
    assert_eq!(arrive(&mut gate, 0.0, frame_age, true), Flags::NONE);
    let mut gate = new_gate();
    arrive(&mut gate, 0.0, 0.0, true);
    assert_eq!(
        gate.check_gap(frame_gap),
        Flags::NONE,
        "the gap itself is allowed"
    );
}

#[test]
fn a_clock_is_wrong_if_not_finite_or_ahead_or_set_back_by_a_second() {
    let clock = Flags::of(Flag::Clock);
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 9.0] {
        let mut gate = new_gate();
        assert_eq!(arrive(&mut gate, wrong, 5.0, false), clock, "{wrong}");
        // The next frame is not compared with it, but it has arrived.
        assert_eq!(gate.check_gap(5.1), Flags::NONE);
        assert_eq!(arrive(&mut gate, 5.1, 5.1, true), Flags::NONE, "{wrong}");
        assert_eq!(arrive(&mut gate, wrong, 5.2, false), clock, "{wrong}");
        assert_eq!(arrive(&mut gate, 5.3, 5.3, true), Flags::NONE, "{wrong}");
    }
    let mut gate = new_gate();
    assert_eq!(arrive(&mut gate, 5.0, 5.0, true), Flags::NONE);
    assert_eq!(
        arrive(&mut gate, 5.0, 5.0, false),
        Flags::NONE,
        "of this tick"
    );
    assert_eq!(
        arrive(&mut gate, 5.02, 5.0, true),
        Flags::NONE,
        "between two ticks"
    );
    assert_eq!(
        arrive(&mut gate, 5.01, 5.05, false),
        Flags::NONE,
        "out of order, beyond the history"
    );
    assert_eq!(arrive(&mut gate, 6.0, 6.0, true), Flags::NONE);
    assert_eq!(
        arrive(&mut gate, 5.0, 5.1, true),
        Flags::NONE,
        "one second is allowed"
    );
    assert_eq!(
        arrive(&mut gate, 3.0, 3.0, true),
        clock,
        "more than a second"
    );
    assert_eq!(
        arrive(&mut gate, 3.1, 3.1, true),
        Flags::NONE,
        "in order by the new clock"
    );
}

#[test]
fn settings_out_of_range_are_named() {
    type Change = fn(&mut SafetySettings);
    let changes: [(&str, Change); 5] = [
        ("frame_age", |s| s.frame_age = 0.0),
        ("frame_gap", |s| s.frame_gap = f64::NAN),
        ("clock_jump", |s| s.clock_jump = 0.0),
        ("innovation_limit", |s| s.innovation_limit = 0.0),
        ("frozen_travel", |s| s.frozen_travel = 0.0),
    ];
    for (field, change) in changes {
        let mut wrong = safety();
        change(&mut wrong);
        let error = FrameGate::new(&wrong, &dofs()).unwrap_err();
        assert_eq!(error.field, field);
    }
}

#[test]
fn an_innovation_beyond_its_limit_is_refused_and_one_on_it_is_not() {
    let limit = safety().innovation_limit;
    let refused = Flags::of(Flag::Innovation);
    for (distance, expected) in [
        (0.0, Flags::NONE),
        (limit, Flags::NONE),
        (limit.next_up(), refused),
        (f64::INFINITY, refused),
    ] {
        assert_eq!(new_gate().check_innovation(distance), expected);
    }
}
