//! Whether a frame may teach: its time, its picture, and how far it may be from what is expected.

use proptest::prelude::*;
use tautscope_core::{
    Arrival, Belief, Flag, Flags, FrameSettings, FrameWatch, PerDof, Picture, Sighting,
};

use crate::config;
use crate::support::guards;

/// The images of one DOF, with lengths in its least spread.
struct Bench {
    watch: FrameWatch,
    settings: FrameSettings,
    dof: usize,
    belief: Belief,
    travel: PerDof<f64>,
}

impl Bench {
    fn new(dof: usize) -> Self {
        let settings = guards().frames;
        let unit = settings.least_deviation;
        Self {
            watch: FrameWatch::new(settings).unwrap(),
            settings,
            dof,
            belief: Belief {
                state: unit.map(|unit| -3.0 * unit),
                deviation: unit,
            },
            travel: unit.map(|unit| 7.0 * unit),
        }
    }

    fn seen(&self, surprise: f64, deviation: f64) -> PerDof<Sighting> {
        let unit = self.settings.least_deviation[self.dof];
        let mut seen = [0, 1, 2].map(|dof| Sighting {
            command: 0.0,
            travel: self.travel[dof],
            tip: f64::NAN,
            deviation: f64::NAN,
            offsets: (f64::NEG_INFINITY, f64::INFINITY),
        });
        seen[self.dof].tip = self.belief.state[self.dof] + surprise * unit;
        seen[self.dof].deviation = deviation * unit;
        seen
    }

    fn refuses(&self, surprise: f64, deviation: f64) -> bool {
        let seen = self.seen(surprise, deviation);
        let doubts = self.watch.doubts(&self.belief, [1e3; 3], &seen);
        doubts.has(Flag::Innovation)
    }

    /// Found from what an image without deviation of its own may say.
    fn spread(&self) -> f64 {
        let limit = self.settings.innovation_limit;
        let (mut fits, mut refused) = (0.0, 1e4);
        for _ in 0..60 {
            let middle = f64::midpoint(fits, refused);
            if self.refuses(middle * limit, 0.0) {
                refused = middle;
            } else {
                fits = middle;
            }
        }
        fits
    }

    fn goes(&mut self, way: f64) {
        self.travel[self.dof] += way * self.settings.least_deviation[self.dof];
    }

    /// An image that is believed; the square of the spread then.
    fn accept(&mut self, surprise: f64, way: f64) -> f64 {
        self.goes(way);
        let seen = self.seen(surprise, 0.1);
        self.watch.accept(&self.belief, &seen);
        self.spread().powi(2)
    }
}

fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-6 * expected.abs().max(1.0)
}

proptest! {
    #![proptest_config(config())]

    /// surprise^2 > limit^2 (spread^2 + deviation^2), with the spread of the start
    #[test]
    fn an_innovation_is_refused_beyond_so_many_deviations(
        dof in 0..3_usize, share in 0.1..2.0_f64, deviation in 0.0..30.0, above in prop::bool::ANY,
    ) {
        prop_assume!(f64::abs(share - 1.0) > 1e-6);
        let bench = Bench::new(dof);
        let start = bench.settings.start_deviation[dof] / bench.settings.least_deviation[dof];
        let limit = bench.settings.innovation_limit * f64::hypot(start, deviation);
        let surprise = if above { share * limit } else { -share * limit };
        prop_assert_eq!(bench.refuses(surprise, deviation), share > 1.0);
        // Of what has no deviation nothing is said.
        prop_assert!(!bench.refuses(surprise, f64::NAN));
        prop_assert!(!bench.refuses(f64::NAN, deviation));
    }

    /// The square of the spread goes to that of the innovations, by the same share of what is left each time.
    #[test]
    fn the_spread_follows_innovations_up_at_once_and_down_slowly_with_motion(
        dof in 0..3_usize, large in 40.0..200.0, small in 2.0..5.0,
    ) {
        let mut bench = Bench::new(dof);
        let left = |bench: &mut Bench, surprise: f64, way: f64| {
            let before = bench.spread().powi(2) - surprise * surprise;
            (bench.accept(surprise, way) - surprise * surprise) / before
        };
        let up = left(&mut bench, large, 0.0);
        prop_assert!((0.3..0.9).contains(&up), "{}", up);
        prop_assert!(near(left(&mut bench, -large, 5.0), up), "with motion as well as without");
        let rest = left(&mut bench, small, 0.0);
        prop_assert!(near(rest, 1.0), "at rest nothing is learnt: {}", rest);
        let down = left(&mut bench, small, 1.0);
        prop_assert!(down > up && down < 0.99, "{}", down);
        let far = left(&mut bench, -small, 9.0);
        prop_assert!(near(far, down), "an image counts once: {}, not {}", far, down);
        let half = left(&mut bench, small, 0.5);
        prop_assert!(near(half, f64::midpoint(1.0, down)), "{}, not half of {}", half, down);
    }

    /// Both grow by `blind_growth` of the travel, and no farther than at the start; motion already seen counts no more.
    #[test]
    fn what_is_not_seen_may_be_farther_off(dof in 0..3_usize, ways in prop::collection::vec(0.0..20.0, 1..6)) {
        let mut bench = Bench::new(dof);
        for _ in 0..300 {
            bench.accept(0.5, 4.0);
        }
        let least = bench.spread();
        prop_assert!(near(least, 1.0), "the least spread there is: {}", least);
        let start = bench.settings.start_deviation[dof] / bench.settings.least_deviation[dof];
        let mut blind = 0.0;
        for way in ways {
            bench.goes(way);
            blind += way * bench.settings.blind_growth;
            bench.watch.miss(bench.travel);
            let spread = bench.spread();
            let expected = (1.0 + blind).min(start);
            prop_assert!(near(spread, expected), "{}, not {}", spread, expected);
            let reach = bench.settings.jump[dof] / bench.settings.least_deviation[dof] + blind.min(start);
            for (far, jumps) in [(reach - 1e-6, false), (reach + 1e-6, true)] {
                let doubts = bench.watch.doubts(&bench.belief, [0.0; 3], &bench.seen(far, 0.0));
                prop_assert_eq!(doubts.has(Flag::Jump), jumps, "{}", far);
            }
        }
        // A wider spread than the start's, which large innovations have taught, stays.
        let wide = bench.accept(50.0 * start, 0.0).sqrt();
        bench.goes(1.0);
        bench.watch.miss(bench.travel);
        prop_assert!(near(bench.spread(), wide));
        bench.watch.forget();
        prop_assert!(near(bench.spread(), start));
    }

    /// From the first image of a picture on, in any one DOF.
    #[test]
    fn a_picture_does_not_repeat_itself_once_something_has_moved(
        dof in 0..3_usize, ways in prop::collection::vec(0.0..0.7, 1..8), known in prop::bool::ANY,
    ) {
        let settings = guards().frames;
        let mut watch = FrameWatch::new(settings).unwrap();
        let mut travel = settings.frozen_travel.map(|limit| 3.7 * limit);
        let mut arrive = |picture: Option<Picture>, travel: Option<PerDof<f64>>| {
            watch.arrive(&Arrival { captured_at: 1.0, now: 1.0, picture, travel })
        };
        let [first, other] = if known {
            [Picture::Checksum(7), Picture::Checksum(8)]
        } else {
            [Picture::Features([1, 2, 3, 4]), Picture::Features([1, 2, 3, 5])]
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
fn said(watch: &mut FrameWatch, captured_at: f64, now: f64, known: bool) -> Flags {
    let travel = known.then_some([0.0; 3]);
    watch.arrive(&Arrival {
        captured_at,
        now,
        picture: None,
        travel,
    })
}

#[test]
fn a_frame_is_late_beyond_its_age_and_missed_beyond_the_gap() {
    let FrameSettings {
        frame_age,
        frame_gap,
        ..
    } = guards().frames;
    let late = Flags::of(Flag::Late);
    for start in [0.0, 5.0] {
        let mut watch = FrameWatch::new(guards().frames).unwrap();
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
    let mut watch = FrameWatch::new(guards().frames).unwrap();
    assert_eq!(said(&mut watch, 0.0, frame_age, true), Flags::NONE);
    let mut watch = FrameWatch::new(guards().frames).unwrap();
    said(&mut watch, 0.0, 0.0, true);
    assert_eq!(watch.tick(frame_gap), Flags::NONE, "itself is allowed");
}

#[test]
fn a_clock_is_wrong_that_is_no_number_or_ahead_or_goes_back_for_long() {
    let clock = Flags::of(Flag::Clock);
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 9.0] {
        let mut watch = FrameWatch::new(guards().frames).unwrap();
        assert_eq!(said(&mut watch, wrong, 5.0, false), clock, "{wrong}");
        // It is not what the next is compared with, but it has come.
        assert_eq!(watch.tick(5.1), Flags::NONE);
        assert_eq!(said(&mut watch, 5.1, 5.1, true), Flags::NONE, "{wrong}");
        assert_eq!(said(&mut watch, wrong, 5.2, false), clock, "{wrong}");
        assert_eq!(said(&mut watch, 5.3, 5.3, true), Flags::NONE, "{wrong}");
    }
    let mut watch = FrameWatch::new(guards().frames).unwrap();
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
    type Change = fn(&mut FrameSettings);
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
        let mut wrong = guards().frames;
        change(&mut wrong);
        assert_eq!(FrameWatch::new(wrong).unwrap_err().field, field);
    }
    let mut sound = guards().frames;
    sound.blind_growth = 0.0;
    FrameWatch::new(sound).unwrap();
}
