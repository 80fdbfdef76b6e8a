//! When images update the estimate of the whole loop, and when they do not.

use crate::article::play::{Play, PlayState};
use crate::dof::PerDof;
use crate::r#loop::any_loop::{BandLoop as _, Loop as _};
use crate::r#loop::profile::BandProfile;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reactions::Reaction;

use super::support::loops::{Loop, article, best, model};
use super::support::{PERIOD, UNITS, safety};

const CENTRES: PerDof<f64> = [0.025, 0.0, 0.9];
/// Once forth and back [s].
const SWING: f64 = 8.0;

/// A loop and an instrument whose insertion has slack; exact images.
struct Run<P> {
    reduction: Loop<P>,
    slack: Play,
    tip: PlayState,
    tick: u32,
}

impl<P: BandProfile> Run<P> {
    fn new(reduction: Loop<P>, minus: f64, plus: f64) -> Self {
        Self {
            reduction,
            slack: Play::new(minus * UNITS[0], plus * UNITS[0]).unwrap(),
            tip: PlayState { output: CENTRES[0] },
            tick: 0,
        }
    }

    fn tick(&mut self) {
        let time = f64::from(self.tick) * PERIOD;
        let mut reference = CENTRES;
        reference[0] += 16e-3 * (std::f64::consts::TAU * time / SWING).sin();
        let [insertion, rotation, bending] = self.reduction.step(reference, None, time);
        self.slack.step(&mut self.tip, insertion);
        if self.tick.is_multiple_of(8) {
            let seen = model().predict([self.tip.output, rotation, bending]);
            let features = seen.map(|seen| seen.features);
            self.reduction
                .on_features(features, None, time, Some(u64::from(self.tick)));
        }
        self.tick += 1;
    }

    fn swing(&mut self, count: u32) {
        for _ in 0..count * 1600 {
            self.tick();
        }
    }

    /// Of the insertion, in its unit.
    fn estimated(&self) -> (f64, f64) {
        let [play, ..] = self.reduction.play();
        (play.delta_minus() / UNITS[0], play.delta_plus() / UNITS[0])
    }
}

/// With each offset within `tolerance` units.
fn is_estimated_and_held<P: BandProfile>(reduction: Loop<P>, tolerance: f64) {
    let mut run = Run::new(reduction, -6.0, 9.0);
    run.swing(4);
    let (minus, plus) = run.estimated();
    assert!(
        (minus + 6.0).abs() < tolerance && (plus - 9.0).abs() < tolerance,
        "{minus} {plus}"
    );
    let before = run.estimated();
    run.slack = Play::new(-3.0 * UNITS[0], 3.0 * UNITS[0]).unwrap();
    for _ in 0..400 {
        run.reduction.raise(Flag::Frozen);
        run.tick();
        let reaction = run.reduction.supervision().reaction;
        assert_eq!(reaction, Reaction::HoldEstimate);
    }
    let after = run.estimated();
    // The offsets of profile `best` may depend on the position.
    let widened = (after.1 - after.0) - (before.1 - before.0);
    assert!(widened.abs() < 0.5, "{before:?} {after:?}");
}

#[test]
fn measurements_update_profile_paper_unless_the_estimate_is_held() {
    is_estimated_and_held(article(|_| Play::new(0.0, 0.0).unwrap()), 1.0);
}

#[test]
fn measurements_update_profile_best_unless_the_estimate_is_held() {
    is_estimated_and_held(best(), 2.5);
}

#[test]
fn the_estimated_slack_stays_within_its_limits() {
    // 36 wide, and 30 may be.
    let start = article(|unit| Play::new(-13.0 * unit, 13.0 * unit).unwrap());
    let mut run = Run::new(start, -18.0, 18.0);
    let mut widest = 0.0_f64;
    for _ in 0..6 * 1600 {
        run.tick();
        let (minus, plus) = run.estimated();
        widest = widest.max(plus - minus);
    }
    assert!((28.0..=30.0 + 1e-9).contains(&widest), "{widest}");
    let latched = run.reduction.supervision().latched;
    assert!(latched.contains(Flag::WidthLimit));
}

#[test]
fn a_hold_ends_after_reference_travel_counted_in_widths() {
    let mut reduction = article(|_| Play::new(0.0, 0.0).unwrap());
    let mut reference = CENTRES;
    reduction.step(reference, None, 0.0);
    // Four widths of 12 mm end it, and 2 s do not.
    for tick in 1..=400_u32 {
        let gone = f64::from(tick) * 0.15e-3 / 12e-3;
        reference[0] += if (tick / 100).is_multiple_of(2) {
            0.15e-3
        } else {
            -0.15e-3
        };
        reduction.raise(Flag::Frozen);
        reduction.step(reference, None, f64::from(tick) * PERIOD);
        let reaction = reduction.supervision().reaction;
        if gone < 3.9 {
            assert_eq!(reaction, Reaction::HoldEstimate, "after {gone} widths");
        } else if gone > 4.1 {
            assert_eq!(reaction, Reaction::Fade, "after {gone} widths");
        }
    }
}

#[test]
fn a_flag_at_its_last_level_stays() {
    let mut reduction = article(|_| Play::new(0.0, 0.0).unwrap());
    reduction.step(CENTRES, None, 0.0);
    for tick in 1..=10_000_u32 {
        reduction.raise(Flag::Frozen);
        reduction.step(CENTRES, None, f64::from(tick) * PERIOD);
        if tick > 1000 {
            let reaction = reduction.supervision().reaction;
            assert_eq!(reaction, Reaction::Fade, "tick {tick}");
        }
    }
}

/// Images of a straight section do not determine the rotation.
#[test]
fn a_dof_that_images_do_not_determine_is_reported_once_it_has_moved_and_not_before() {
    let mut reduction = article(|_| Play::new(0.0, 0.0).unwrap());
    let (mut tick, mut reference) = (0_u32, [CENTRES[0], 0.0, 0.0]);
    let mut go = |by: [f64; 2]| {
        for _ in 0..400 {
            reference[0] += by[0] / 400.0;
            reference[1] += by[1] / 400.0;
            let time = f64::from(tick) * PERIOD;
            let command = reduction.step(reference, None, time);
            if tick.is_multiple_of(8) {
                let features = model().predict(command).map(|seen| seen.features);
                reduction.on_features(features, None, time, Some(u64::from(tick)));
            }
            tick += 1;
        }
        reduction.supervision().flags
    };
    let width = safety().width_limit[1];
    assert_eq!(go([5e-3, 0.0]), Flags::NONE);
    assert_eq!(go([0.0, 0.2 * width]), Flags::NONE);
    assert_eq!(go([0.0, 0.1 * width]), Flags::of(Flag::Unobservable));
}
