//! Slack learnt anew: when it is said, and when not.

use crate::dof::PerDof;
use crate::supervision::change_watch::{ChangeSettings, ChangeWatch};
use crate::supervision::flags::{Flag, Flags};
use proptest::prelude::*;

use super::config;
use super::support::safety;

fn settings() -> ChangeSettings {
    let safety = safety();
    ChangeSettings {
        limit: safety.change_limit,
        travel: safety.width_limit.map(|width| safety.change_travel * width),
    }
}

/// One DOF after the other, with lengths in its limit and its travel.
struct Bench {
    watch: ChangeWatch,
    dof: usize,
    side: usize,
    gone: PerDof<f64>,
}

impl Bench {
    fn new(dof: usize, side: usize) -> Self {
        let watch = ChangeWatch::new(settings()).unwrap();
        let gone = [0.0; 3];
        Self {
            watch,
            dof,
            side,
            gone,
        }
    }

    /// One that has learnt all there is.
    fn calm(dof: usize, side: usize) -> Self {
        let mut bench = Self::new(dof, side);
        for _ in 0..25 {
            assert_eq!(bench.image(0.0, 0.1), Flags::NONE);
        }
        bench
    }

    fn image(&mut self, change: f64, travel: f64) -> Flags {
        let ChangeSettings {
            limit,
            travel: reach,
        } = settings();
        let mut changes = [[0.0; 2]; 3];
        changes[self.dof][self.side] = change * limit[self.dof];
        self.gone[self.dof] += travel * reach[self.dof];
        self.watch.look(changes, self.gone)
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn what_was_learnt_and_changes_is_said_however_slowly(
        dof in 0..3_usize,
        side in 0..2_usize,
        images in 1..30_u32,
        upwards in prop::bool::ANY,
    ) {
        for (far, expected) in [(0.99, Flags::NONE), (1.6, Flags::of(Flag::SlackChanged))] {
            let mut bench = Bench::calm(dof, side);
            let each = if upwards { far } else { -far } / f64::from(images);
            let mut all = Flags::NONE;
            for _ in 0..images {
                // All of it within 0.9 of a travel, over which 1.6 fades to 1.06.
                all = all.union(bench.image(each, 0.9 / f64::from(images)));
            }
            prop_assert_eq!(all, expected);
        }
    }

    #[test]
    fn noise_and_what_comes_back_are_not(
        noise in prop::collection::vec(-0.4..0.4_f64, 50..200),
        travel in 0.0..0.2_f64,
    ) {
        let mut bench = Bench::calm(0, 1);
        for change in noise {
            prop_assert_eq!(bench.image(change, travel), Flags::NONE);
            prop_assert_eq!(bench.image(-change, travel), Flags::NONE);
        }
    }
}

#[test]
fn the_first_lesson_is_no_surprise_and_the_next_is_once_it_has_been_quiet() {
    let mut bench = Bench::new(1, 0);
    for _ in 0..20 {
        assert_eq!(bench.image(5.0, 0.1), Flags::NONE);
    }
    // The sum fades to half the limit, and stays there for two travels.
    for _ in 0..80 {
        assert_eq!(bench.image(0.0, 0.1), Flags::NONE);
    }
    assert_eq!(bench.image(1.1, 0.0), Flags::of(Flag::SlackChanged));
    assert_eq!(bench.image(-1.1, 0.0), Flags::NONE);
}

/// Within half the limit for two travels, and neither counts if it is just reached.
#[test]
fn learnt_is_what_has_stayed_as_it_was() {
    let said = Flags::of(Flag::SlackChanged);
    for (stays, learnt) in [(0.4, true), (0.6, false), (-0.6, false)] {
        let mut bench = Bench::new(2, 1);
        bench.image(stays, 0.0);
        for _ in 0..100 {
            // As much again as fades.
            let fades = -stays * libm::expm1(-0.1);
            assert_eq!(bench.image(fades, 0.1), Flags::NONE);
        }
        let more = if stays > 0.0 { 1.0 } else { -1.0 };
        assert_eq!(bench.image(more, 0.0) == said, learnt, "{stays}");
    }
    let mut bench = Bench::new(0, 0);
    assert_eq!(bench.image(0.5, 2.0), Flags::NONE);
    assert_eq!(bench.image(0.5, 0.0), Flags::NONE, "the limit itself");
    assert_eq!(bench.image(0.1, 0.0), said);
    let mut bench = Bench::new(0, 0);
    assert_eq!(bench.image(0.0, 1.9), Flags::NONE);
    assert_eq!(bench.image(1.1, 0.0), Flags::NONE, "not yet learnt");
}

#[test]
fn what_is_no_number_changes_nothing() {
    let mut bench = Bench::calm(0, 0);
    assert_eq!(bench.image(f64::NAN, 0.1), Flags::NONE);
    assert_eq!(bench.image(1.1, 0.0), Flags::of(Flag::SlackChanged));
}

#[test]
fn bad_settings_are_named() {
    type Change = fn(&mut ChangeSettings);
    let changes: [(&str, Change); 2] = [
        ("change_limit", |s| s.limit[0] = 0.0),
        ("change_travel", |s| s.travel[2] = f64::NAN),
    ];
    for (field, change) in changes {
        let mut wrong = settings();
        change(&mut wrong);
        assert_eq!(ChangeWatch::new(wrong).unwrap_err().field, field);
    }
}
