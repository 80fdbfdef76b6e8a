//! Compensation that fades and returns with motion; a tip that overtakes the reference.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::r#loop::any_loop::{BandLoop as _, Loop as _};
use crate::r#loop::paper::Paper;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reactions::Reaction;
use crate::supervision::settings::SafetySettings;

use super::support::loops::{Loop, article, article_with, model};
use super::support::{PERIOD, UNITS, safety};

const START: PerDof<f64> = [0.025, 0.0, 0.9];

/// A reference that moves forth and back along the insertion, in its unit.
struct Strokes {
    reduction: Loop<Paper>,
    tick: u32,
    place: f64,
    side: f64,
    command: PerDof<f64>,
}

impl Strokes {
    fn new(mut reduction: Loop<Paper>) -> Self {
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

    /// Move on; the increment of the command over that of the reference.
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

    /// Move by so many units, with nominal images and a flag of the rig; the largest factor.
    fn travel(&mut self, units: u32, flag: Option<Flag>) -> f64 {
        let mut most = 0.0_f64;
        for _ in 0..10 * units {
            if let Some(flag) = flag {
                self.reduction.raise(flag);
            }
            most = most.max(self.go(0.1));
            if self.tick.is_multiple_of(8) {
                self.image_update(self.reduction.predicted_state());
            }
        }
        most
    }

    /// Image update with a given tip.
    fn image_update(&mut self, tip: PerDof<f64>) {
        let features = model().predict(tip).map(|seen| seen.features);
        let time = self.time();
        self.reduction
            .on_features(features, None, time, Some(u64::from(self.tick)));
    }
}

#[test]
fn compensation_fades_with_motion_and_returns_with_it_once_the_cause_is_gone() {
    fades_and_returns(Flag::Frozen);
}

#[test]
fn overcompensation_that_lasts_fades_compensation_as_a_fault_of_the_images_does() {
    fades_and_returns(Flag::Overcompensation);
}

/// A sensor that never speaks is as bad as one that falls silent.
#[test]
fn compensation_fades_without_a_first_measurement_and_returns_with_it() {
    let play = |unit: f64| Play::new(-12.0 * unit, 12.0 * unit).unwrap();
    let mut strokes = Strokes::new(article_with(&safety(), 0.0, play));
    let has = |strokes: &Strokes| {
        let flags = strokes.reduction.supervision().flags;
        flags.contains(Flag::Dropped)
    };
    for _ in 0..74 {
        strokes.go(0.1);
    }
    // A quarter of the width of 30, and then as long as a first measurement may take.
    let ticks = (0..1000).take_while(|_| {
        strokes.go(0.1);
        !has(&strokes)
    });
    let waited = f64::from(u32::try_from(ticks.count()).unwrap()) * PERIOD;
    assert!((waited - 0.48).abs() < 3.0 * PERIOD, "{waited} s");
    for _ in 0..1800 {
        strokes.go(0.1);
    }
    assert_eq!(strokes.reduction.supervision().lead, 0.0);
    strokes.travel(100, None);
    assert!(!has(&strokes));
    assert_eq!(strokes.reduction.supervision().lead, 1.0);
}

fn fades_and_returns(flag: Flag) {
    let play = |unit: f64| Play::new(-12.0 * unit, 12.0 * unit).unwrap();
    let mut strokes = Strokes::new(article(play));
    let whole = |factor: f64| (factor - 5.0).abs() < 1e-6;
    let none = |factor: f64| (factor - 1.0).abs() < 1e-6;
    assert!(whole(strokes.travel(100, None)));
    // Four widths of 30, and two more to fade.
    assert!(whole(strokes.travel(100, Some(flag))));
    strokes.travel(82, Some(flag));
    let supervision = strokes.reduction.supervision();
    assert_eq!(
        (supervision.reaction, supervision.lead),
        (Reaction::Fade, 0.0)
    );
    let factor = strokes.travel(100, Some(flag));
    assert!(none(factor), "{factor}");
    // Five good frames, then two widths.
    strokes.travel(34, None);
    let supervision = strokes.reduction.supervision();
    assert_eq!(supervision.reaction, Reaction::None);
    assert!(
        (0.3..0.6).contains(&supervision.lead),
        "{}",
        supervision.lead
    );
    strokes.travel(34, None);
    let supervision = strokes.reduction.supervision();
    assert_eq!(supervision.lead, 1.0);
    assert_eq!(supervision.latched, Flags::of(flag));
    let factor = strokes.travel(100, None);
    assert!(whole(factor), "{factor}");
}

/// The instrument has no slack.
#[test]
fn a_tip_that_overtakes_the_reference_is_reported_unless_its_detector_is_off() {
    for off in [Flags::NONE, Flags::of(Flag::Overcompensation)] {
        let settings = SafetySettings { off, ..safety() };
        let play = |unit: f64| Play::new(-12.0 * unit, 12.0 * unit).unwrap();
        let mut strokes = Strokes::new(article_with(&settings, 0.0, play));
        for tick in 1..=400_u32 {
            strokes.go(0.4);
            if tick.is_multiple_of(8) {
                strokes.image_update(strokes.command);
            }
        }
        let latched = strokes.reduction.supervision().latched;
        assert_eq!(
            latched.contains(Flag::Overcompensation),
            off.is_empty(),
            "{latched:?}"
        );
    }
}

/// By a gain above that of the instrument, which no offset explains.
#[test]
fn compensation_fades_for_as_long_as_a_tip_overtakes_the_reference() {
    let play = |unit: f64| Play::new(-6.0 * unit, 6.0 * unit).unwrap();
    let mut strokes = Strokes::new(article(play));
    let mut least = 1.0_f64;
    for _ in 0..8000 {
        strokes.go(0.01);
        if strokes.tick.is_multiple_of(8) {
            let mut tip = strokes.command;
            tip[0] += 0.7 * (tip[0] - START[0]);
            strokes.image_update(tip);
        }
        least = least.min(strokes.reduction.supervision().lead);
    }
    assert!(least < 0.6, "{least}");
}
