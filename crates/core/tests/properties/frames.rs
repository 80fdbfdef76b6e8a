//! Whether a frame may teach: its time and its picture.

use crate::dof::PerDof;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::frame_gate::{FrameArrival, FrameGate, FrameGateSettings, ImageIdentity};
use proptest::prelude::*;

use super::config;
use super::support::monitors;

proptest! {
    #![proptest_config(config())]

    /// From the first image of a picture on, in any one DOF.
    #[test]
    fn a_picture_does_not_repeat_itself_once_something_has_moved(
        dof in 0..3_usize, ways in prop::collection::vec(0.0..0.7, 1..8), known in prop::bool::ANY,
    ) {
        let settings = monitors().frames;
        let mut watch = FrameGate::new(settings).unwrap();
        let mut travel = settings.frozen_travel.map(|limit| 3.7 * limit);
        let mut arrive = |picture: Option<ImageIdentity>, travel: Option<PerDof<f64>>| {
            watch.arrive(&FrameArrival { captured_at: 1.0, now: 1.0, picture, travel })
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
            travel[dof] += way * settings.frozen_travel[dof];
            prop_assume!(f64::abs(gone - 1.0) > 1e-9);
            prop_assert_eq!(arrive(Some(first), Some(travel)), Flags::when(gone > 1.0, Flag::Frozen));
            prop_assert_eq!(arrive(None, Some(travel)), Flags::NONE);
            prop_assert_eq!(arrive(Some(first), None), Flags::NONE);
        }
        prop_assert_eq!(arrive(Some(other), Some(travel)), Flags::NONE);
        prop_assert_eq!(arrive(Some(first), Some(travel)), Flags::NONE);
    }
}

/// `(captured_at, now, whether its place in the history is known)`, and what is said of its time.
fn said(watch: &mut FrameGate, captured_at: f64, now: f64, known: bool) -> Flags {
    let travel = known.then_some([0.0; 3]);
    watch.arrive(&FrameArrival {
        captured_at,
        now,
        picture: None,
        travel,
    })
}

#[test]
fn a_frame_is_late_beyond_its_age_and_missed_beyond_the_gap() {
    let FrameGateSettings {
        frame_age,
        frame_gap,
        ..
    } = monitors().frames;
    let late = Flags::of(Flag::Late);
    for start in [0.0, 5.0] {
        let mut watch = FrameGate::new(monitors().frames).unwrap();
        assert_eq!(watch.tick(start + 100.0), Flags::NONE, "none to miss yet");
        assert_eq!(said(&mut watch, start, start, true), Flags::NONE);
        for (gap, missed) in [(0.5, false), (0.999, false), (1.001, true), (3.0, true)] {
            let flags = watch.tick(start + gap * frame_gap);
            assert_eq!(flags, Flags::when(missed, Flag::Dropped), "{gap}");
        }
        let now = start + 10.0;
        assert_eq!(
            said(&mut watch, now - 0.999 * frame_age, now, true),
            Flags::NONE
        );
        assert_eq!(said(&mut watch, now - 1.001 * frame_age, now, true), late);
        assert_eq!(said(&mut watch, now - 2.0 * frame_age, now, true), late);
        assert_eq!(watch.tick(now), Flags::NONE, "late, and not missed");
        assert_eq!(
            said(&mut watch, now, f64::NAN, true),
            Flags::NONE,
            "that is the tick's to say"
        );
        assert_eq!(watch.tick(now), Flags::NONE);
    }
    let mut watch = FrameGate::new(monitors().frames).unwrap();
    assert_eq!(said(&mut watch, 0.0, frame_age, true), Flags::NONE);
    let mut watch = FrameGate::new(monitors().frames).unwrap();
    said(&mut watch, 0.0, 0.0, true);
    assert_eq!(watch.tick(frame_gap), Flags::NONE, "itself is allowed");
}

#[test]
fn a_clock_is_wrong_that_is_no_number_or_ahead_or_goes_back_for_long() {
    let clock = Flags::of(Flag::Clock);
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 9.0] {
        let mut watch = FrameGate::new(monitors().frames).unwrap();
        assert_eq!(said(&mut watch, wrong, 5.0, false), clock, "{wrong}");
        // It is not what the next is compared with, but it has come.
        assert_eq!(watch.tick(5.1), Flags::NONE);
        assert_eq!(said(&mut watch, 5.1, 5.1, true), Flags::NONE, "{wrong}");
        assert_eq!(said(&mut watch, wrong, 5.2, false), clock, "{wrong}");
        assert_eq!(said(&mut watch, 5.3, 5.3, true), Flags::NONE, "{wrong}");
    }
    let mut watch = FrameGate::new(monitors().frames).unwrap();
    assert_eq!(said(&mut watch, 5.0, 5.0, true), Flags::NONE);
    assert_eq!(
        said(&mut watch, 5.0, 5.0, false),
        Flags::NONE,
        "of this very tick"
    );
    assert_eq!(
        said(&mut watch, 5.02, 5.0, true),
        Flags::NONE,
        "between two ticks"
    );
    assert_eq!(
        said(&mut watch, 5.01, 5.05, false),
        Flags::NONE,
        "out of order, beyond the history"
    );
    assert_eq!(said(&mut watch, 6.0, 6.0, true), Flags::NONE);
    assert_eq!(
        said(&mut watch, 5.0, 5.1, true),
        Flags::NONE,
        "by a second, which is allowed"
    );
    assert_eq!(said(&mut watch, 3.0, 3.0, true), clock, "by more");
    assert_eq!(
        said(&mut watch, 3.1, 3.1, true),
        Flags::NONE,
        "by the new clock"
    );
}

#[test]
fn settings_out_of_range_are_named() {
    type Change = fn(&mut FrameGateSettings);
    let changes: [(&str, Change); 10] = [
        ("frame_age", |s| s.frame_age = 0.0),
        ("frame_gap", |s| s.frame_gap = f64::NAN),
        ("innovation_limit", |s| s.innovation_limit = 0.0),
        ("blind_growth", |s| s.blind_growth = -0.1),
        ("frozen_travel", |s| s.frozen_travel[1] = 0.0),
        ("start_deviation", |s| s.start_deviation[2] = 0.0),
        ("jump", |s| s.jump[0] = -1.0),
        ("grip_distance", |s| s.grips[1].distance = 0.0),
        ("slip", |s| s.grips[2].slip = f64::INFINITY),
        ("innovation_floor", |s| s.least_deviation[0] = 0.0),
    ];
    for (field, change) in changes {
        let mut wrong = monitors().frames;
        change(&mut wrong);
        assert_eq!(FrameGate::new(wrong).unwrap_err().field, field);
    }
    let mut sound = monitors().frames;
    sound.blind_growth = 0.0;
    FrameGate::new(sound).unwrap();
}
