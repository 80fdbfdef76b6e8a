//! A tip in contact at its bounds, which numbers of few bits meet exactly, and what counts as a turn.

use crate::supervision::grip::{Grip, GripSettings, Sighting};

const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
const SETTINGS: GripSettings = GripSettings {
    distance: 16.0,
    slip: 5.0,
};
const DEVIATION: f64 = 0.5;
/// A little more of a length of a few units, and a little less.
const MORE: f64 = 1.0 + 1e-12;
const LESS: f64 = 1.0 - 1e-12;

fn seen(command: f64, travel: f64, tip: f64) -> Sighting {
    Sighting {
        command,
        travel,
        tip,
        deviation: DEVIATION,
        offsets: ANY,
    }
}

/// A tip that goes with its command from place to place, nothing else moving it.
fn follow(grip: &mut Grip, places: impl IntoIterator<Item = f64>) -> f64 {
    let mut travel = 0.0;
    let mut last: Option<f64> = None;
    for place in places {
        travel += last.map_or(0.0, |last| (place - last).abs());
        last = Some(place);
        grip.follow(&seen(place, travel, place));
    }
    travel
}

/// Up to 20 by images enough: a tip that is held.
fn held() -> Grip {
    let mut grip = Grip::new(SETTINGS);
    let travel = follow(&mut grip, (0..=10).map(|image| 2.0 * f64::from(image)));
    assert!((travel - 20.0).abs() < 1e-12);
    assert!(grip.slips(&seen(22.0, 22.0, 0.0)), "it is held");
    grip
}

/// |off| > slip + 0.15 travel + deviation: found by when a tip is held that was as far off in the last image needed.
#[test]
fn a_tip_is_off_beyond_the_bound_and_not_on_it() {
    let bound: f64 = SETTINGS.slip + 3.0 + DEVIATION;
    for (off, is_held) in [
        (bound, true),
        (-bound, true),
        (bound * MORE, false),
        (-bound * MORE, false),
    ] {
        let mut grip = Grip::new(SETTINGS);
        follow(&mut grip, [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0]);
        grip.follow(&seen(20.0, 20.0, 20.0 + off));
        assert_eq!(grip.slips(&seen(22.0, 22.0, 99.0)), is_held, "{off}");
    }
}

/// least - slip - deviation <= c - m <= largest + slip + deviation, once the command has turned three times.
#[test]
fn a_tip_is_behind_beyond_what_was_learnt_and_not_on_it() {
    let (least, most) = (-2.0, 3.0);
    let spare = SETTINGS.slip + DEVIATION;
    for (offset, slips) in [
        (most + spare, false),
        ((most + spare) * MORE, true),
        (least - spare, false),
        ((least - spare) * MORE, true),
    ] {
        let mut grip = Grip::new(SETTINGS);
        let mut travel: f64 = 0.0;
        for place in [0.0, 4.0, 2.0, 6.0, 4.0_f64] {
            travel += 4.0;
            grip.follow(&Sighting {
                offsets: (least, most),
                ..seen(place, travel, place)
            });
        }
        let next = seen(3.0, travel + 1.0, 3.0 - offset);
        assert_eq!(grip.slips(&next), slips, "{offset}");
    }
}

/// What is no number, of command or tip, is no image.
#[test]
fn an_image_of_no_tip_says_nothing() {
    let before = held();
    for (command, tip) in [
        (22.0, f64::NAN),
        (10.0, f64::NAN),
        (f64::NAN, 22.0),
        (f64::INFINITY, 22.0),
        (22.0, f64::NEG_INFINITY),
    ] {
        let mut grip = before;
        grip.follow(&seen(command, 22.0, tip));
        assert_eq!(grip, before, "{command}, {tip}");
    }
}

/// By less than 0.007 of `distance` between two images a command rests, and its tip may creep.
#[test]
fn a_tip_is_held_that_goes_with_a_command_which_does_not_rest() {
    for (step, is_held) in [(7.0, true), (7.0 * LESS, false), (14.0, true), (0.5, false)] {
        let mut grip = Grip::new(GripSettings {
            distance: 1000.0,
            slip: 5.0,
        });
        let images = 2000;
        let places = (0..=images).map(|image| step * f64::from(image));
        let travel = follow(&mut grip, places);
        assert_eq!(
            grip.slips(&seen(travel + step, travel + step, 0.0)),
            is_held,
            "{step}"
        );
    }
}

/// Held as before, until nothing is known; what was learnt of the slack, too.
#[test]
fn what_is_released_is_as_at_the_start() {
    let mut grip = held();
    grip.release();
    assert!(!grip.slips(&seen(22.0, 22.0, 0.0)));
    let mut grip = Grip::new(SETTINGS);
    let turning = |offsets: (f64, f64), grip: &mut Grip| {
        for (place, travel) in [(0.0, 0.0), (4.0, 4.0), (2.0, 6.0), (6.0, 10.0), (4.0, 12.0)] {
            grip.follow(&Sighting {
                offsets,
                ..seen(place, travel, place)
            });
        }
    };
    let left_behind = seen(3.0, 13.0, -40.0);
    turning((-1.0, 1.0), &mut grip);
    assert!(grip.slips(&left_behind));
    grip.release();
    assert!(!grip.slips(&left_behind));
    grip.follow(&seen(3.0, 13.0, 3.0));
    assert!(!grip.slips(&seen(2.0, 14.0, -40.0)), "no turn is counted");
}

/// Friction that another DOF takes lets go of a tip, by more than 0.1 slip.
#[test]
fn a_tip_that_another_dof_lets_go_of_is_held_no_longer() {
    let freed = 0.5;
    for (more, is_held) in [
        (0.0, true),
        (0.6 * freed, true),
        (freed, true),
        (freed + 1e-9, false),
        (4.0, false),
    ] {
        // As far in one step as in many: what the command itself moves by is not it.
        for step in [0.25, 2.0, 8.0] {
            let grip = held();
            let next = seen(20.0 + step, 20.0 + step + more, 0.0);
            assert_eq!(grip.slips(&next), is_held, "{more}, {step}");
            let mut grip = grip;
            grip.follow(&seen(20.0 + step, 20.0 + step + more, 20.0 + step));
            let next = seen(21.0 + step, 21.0 + step + more, 0.0);
            assert_eq!(grip.slips(&next), is_held, "{more}, {step}, an image later");
        }
    }
}

/// A rest is no turn, and neither is the first motion: slack does not count as learnt by it.
#[test]
fn only_turns_teach_that_a_tip_cannot_be_farther_behind() {
    let slips = |places: &[f64]| {
        let mut grip = Grip::new(SETTINGS);
        let mut travel = 0.0;
        let mut last = 0.0;
        for place in places {
            travel += f64::abs(place - last);
            last = *place;
            grip.follow(&Sighting {
                offsets: (-1.0, 1.0),
                ..seen(last, travel, last)
            });
        }
        grip.slips(&seen(last - 1.0, travel + 1.0, last + 40.0))
    };
    assert!(slips(&[0.0, 4.0, 2.0, 4.0, 2.0]), "three turns");
    assert!(!slips(&[0.0, 4.0, 2.0, 4.0]), "two");
    assert!(!slips(&[0.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 2.0]), "rests");
    assert!(!slips(&[0.0, 0.0, -4.0, -2.0, -4.0]), "downwards first");
    assert!(slips(&[0.0, 0.0, -4.0, -2.0, -4.0, -2.0, -4.0]));
}
