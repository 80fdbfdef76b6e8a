//! Compensation that is given up with motion, and comes back once the warning has been seen; a tip that outruns its hand.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::r#loop::reduction::HysteresisReduction;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::monitors::MonitorsSettings;
use crate::supervision::reactions::Reaction;

use super::support::looped::{article, article_with, model};
use super::support::{PERIOD, UNITS, monitors};

const START: PerDof<f64> = [0.025, 0.0, 0.9];

/// A hand that goes forth and back along the insertion, in its unit.
struct Hand {
    reduction: Box<HysteresisReduction>,
    tick: u32,
    place: f64,
    side: f64,
    command: PerDof<f64>,
}

impl Hand {
    fn new(mut reduction: Box<HysteresisReduction>) -> Self {
        let command = reduction.step(START, None, 0.0);
        Self {
            reduction,
            tick: 0,
            place: 0.0,
            side: 1.0,
            command,
        }
    }

    fn time(&self) -> f64 {
        f64::from(self.tick) * PERIOD
    }

    /// On by so much: how much farther the command goes, as a factor.
    fn go(&mut self, by: f64) -> f64 {
        if self.side * self.place > 16.0 {
            self.side = -self.side;
        }
        self.place += self.side * by;
        self.tick += 1;
        let mut reference = START;
        reference[0] += self.place * UNITS[0];
        let time = self.time();
        let command = self.reduction.step(reference, None, time);
        let moved = command[0] - self.command[0];
        self.command = command;
        moved / (self.side * by * UNITS[0])
    }

    /// By so many units, with images as they should be, and what the rig says: the largest factor.
    fn travel(&mut self, units: u32, flag: Option<Flag>) -> f64 {
        let mut most = 0.0_f64;
        for _ in 0..10 * units {
            if let Some(flag) = flag {
                self.reduction.monitors_mut().raise(flag);
            }
            most = most.max(self.go(0.1));
            if self.tick.is_multiple_of(8) {
                self.sees(self.reduction.predicted_state());
            }
        }
        most
    }

    /// An image of a tip.
    fn sees(&mut self, tip: PerDof<f64>) {
        let features = model().predict(tip).map(|seen| seen.features);
        let time = self.time();
        self.reduction
            .on_features(features, None, time, Some(u64::from(self.tick)));
    }
}

#[test]
fn compensation_goes_with_motion_and_comes_back_once_the_warning_was_seen() {
    let play = |unit: f64| Play::new(-12.0 * unit, 12.0 * unit).unwrap();
    let mut hand = Hand::new(article(play));
    let whole = |factor: f64| (factor - 5.0).abs() < 1e-6;
    let none = |factor: f64| (factor - 1.0).abs() < 1e-6;
    assert!(whole(hand.travel(100, None)));
    // Four widths of 30, and two more to fade.
    assert!(whole(hand.travel(100, Some(Flag::Frozen))));
    hand.travel(82, Some(Flag::Frozen));
    let supervision = hand.reduction.monitors().supervision();
    assert_eq!(
        (supervision.reaction, supervision.lead),
        (Reaction::Fade, 0.0)
    );
    let factor = hand.travel(100, Some(Flag::Frozen));
    assert!(none(factor), "{factor}");
    assert!(none(hand.travel(5, None)));
    let supervision = hand.reduction.monitors().supervision();
    assert_eq!(supervision.reaction, Reaction::None);
    assert_eq!(supervision.latched, Flags::of(Flag::Frozen));
    let factor = hand.travel(100, None);
    assert!(none(factor), "nobody has seen the warning: {factor}");
    hand.reduction.monitors_mut().acknowledge();
    let supervision = hand.reduction.monitors().supervision();
    assert_eq!(supervision.latched, Flags::NONE);
    hand.travel(62, None);
    assert_eq!(hand.reduction.monitors().supervision().lead, 1.0);
    let factor = hand.travel(100, None);
    assert!(whole(factor), "{factor}");
}

/// More slack made up for than there is: none.
#[test]
fn a_tip_that_outruns_its_hand_is_said_unless_it_is_not_looked_for() {
    for off in [Flags::NONE, Flags::of(Flag::Overcompensation)] {
        let settings = MonitorsSettings { off, ..monitors() };
        let play = |unit: f64| Play::new(-12.0 * unit, 12.0 * unit).unwrap();
        let mut hand = Hand::new(article_with(&settings, 0.0, play));
        for tick in 1..=400_u32 {
            hand.go(0.4);
            if tick.is_multiple_of(8) {
                hand.sees(hand.command);
            }
        }
        let latched = hand.reduction.monitors().supervision().latched;
        assert_eq!(
            latched.has(Flag::Overcompensation),
            off.is_empty(),
            "{latched:?}"
        );
    }
}
