//! Profile `best`, one DOF: what holds whatever it has learnt, and what it achieves on a true play.

use crate::adaptive::axis::AdaptiveAxis;
use crate::adaptive::contact::ContactTest;
use crate::adaptive::lead::LeadLaw;
use crate::adaptive::parameters::AxisParameters;
use crate::adaptive::withheld::ChangeLimit;
use crate::article::play::{Play, PlayState};
use proptest::prelude::*;

use super::offset_map::prior;
use super::{config, plays};

const PERIOD: f64 = 0.005;

pub(crate) fn settings(tremor_time: f64, period: f64) -> AxisParameters {
    AxisParameters {
        law: LeadLaw {
            free_gain: 5.0,
            contact_gain: 2.0,
            taper: 0.1,
            settling: 0.05,
        },
        cautious_gain: 1.5,
        cautious_deviation: 0.1,
        prior: prior(),
        change: ChangeLimit {
            rate: 0.03,
            spare: 0.05,
            known: 1.0,
        },
        contact: ContactTest {
            distance: 0.1,
            moved: 0.1,
            tolerance: 0.25,
        },
        model_deviation: 0.02,
        correction: 1.0,
        gain_limit: 5.0,
        tremor_time,
        period,
    }
}

/// Starts from offsets that are known for certain.
fn certain(play: Play, tremor_time: f64, period: f64) -> AdaptiveAxis {
    let mut settings = settings(tremor_time, period);
    settings.prior.level = 1e-9;
    settings.prior.local = 0.0;
    settings.prior.tilt = 0.0;
    AdaptiveAxis::new(settings, play).unwrap()
}

#[derive(Debug, Clone)]
enum Event {
    Move(f64),
    Hold,
    Learn(f64, f64),
    Spoil(f64),
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let event = prop_oneof![
        6 => (-0.3..0.3).prop_map(Event::Move),
        1 => (-1e-15..1e-15).prop_map(Event::Move),
        1 => Just(Event::Hold),
        3 => (-2.0..2.0, 0.0..1.0).prop_map(|(offset, deviation)| Event::Learn(offset, deviation)),
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY)].prop_map(Event::Spoil),
    ];
    prop::collection::vec(event, 1..200)
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn gain_is_between_nothing_and_the_limit_and_learning_is_bumpless(
        play in plays(), first in -5.0..5.0, events in events(), smooth in any::<bool>()
    ) {
        let time = if smooth { 0.15 } else { 0.0 };
        let mut axis = AdaptiveAxis::new(settings(time, PERIOD), play).unwrap();
        let mut reference = first;
        prop_assert_eq!(axis.step(reference), reference);
        for event in events {
            let before = axis.command();
            match event {
                Event::Move(increment) => {
                    let last = reference;
                    reference += increment;
                    let (moved, asked) = (axis.step(reference) - before, reference - last);
                    let scale = before.abs().max(axis.command().abs()).max(asked.abs());
                    prop_assert!(moved * asked >= 0.0);
                    prop_assert!(moved.abs() <= 5.0 * asked.abs() + 4.0 * f64::EPSILON * scale);
                }
                Event::Hold => prop_assert_eq!(axis.step(reference), before),
                Event::Learn(offset, deviation) => {
                    axis.learn(before, before - offset, deviation, core::iter::empty());
                    prop_assert_eq!(axis.command(), before);
                    prop_assert!(axis.play().width() >= 0.0);
                }
                Event::Spoil(value) => {
                    prop_assert_eq!(axis.step(value), before);
                    axis.learn(value, before, 0.1, core::iter::empty());
                    axis.learn(before, value, 0.1, core::iter::empty());
                    prop_assert_eq!(axis.command(), before);
                }
            }
            let (tip, play) = (axis.predicted_state(), axis.play());
            prop_assert!(tip.is_finite() && play.delta_minus().is_finite());
        }
    }

    /// After enough travel the tip of the true play is where the reference is.
    #[test]
    fn no_outlier_sends_the_play_state_away(
        tilt in 0.0..1.0, outliers in prop::collection::vec(-30.0..30.0, 50..200)
    ) {
        let mut settings = settings(0.0, PERIOD);
        (settings.prior.tilt, settings.prior.tilt_drift) = (tilt, tilt);
        let mut axis = AdaptiveAxis::new(settings, Play::new(0.0, 0.0).unwrap()).unwrap();
        for (turn, outlier) in (0_u32..).zip(outliers) {
            for tick in 0..40_u32 {
                axis.step(2.0 * (0.1 * f64::from(40 * turn + tick)).sin());
            }
            axis.learn(axis.command(), outlier, 0.02, std::iter::empty());
            // Offsets as wide as what was measured, the least stretch, and the command.
            prop_assert!(axis.predicted_state().abs() < 200.0, "{}", axis.predicted_state());
        }
    }

    #[test]
    fn a_known_play_is_inverted_exactly(play in plays(), strokes in prop::collection::vec(0.0..5.0, 1..6)) {
        let mut axis = certain(play, 0.0, PERIOD);
        let mut tip = PlayState { output: 0.0 };
        let (mut reference, mut sign) = (0.0, 1.0);
        axis.step(reference);
        play.step(&mut tip, reference);
        for stroke in strokes {
            for _ in 0..2000 {
                reference += sign * (stroke + 12.0) / 2000.0;
                play.step(&mut tip, axis.step(reference));
            }
            prop_assert!((tip.output - reference).abs() < 1e-6, "{} {}", tip.output, reference);
            sign = -sign;
        }
    }

    /// As finely as one likes, the same way of the hand gives the same command.
    #[test]
    fn the_tick_does_not_matter(play in plays(), turns in prop::collection::vec(-3.0..3.0, 1..6)) {
        let (mut coarse, mut fine) = (certain(play, 0.0, PERIOD), certain(play, 0.0, PERIOD));
        coarse.step(0.0);
        fine.step(0.0);
        let mut last = 0.0;
        for turn in turns {
            for part in 1..=100 {
                coarse.step(last + (turn - last) * f64::from(part) / 100.0);
            }
            for part in 1..=1000 {
                fine.step(last + (turn - last) * f64::from(part) / 1000.0);
            }
            last = turn;
            // A tick starts with what was known before it: the error is one coarse tick at most.
            prop_assert!((coarse.command() - fine.command()).abs() < 0.02, "{}", coarse.command() - fine.command());
        }
    }
}

#[test]
fn nothing_drifts_over_a_hundred_thousand_reversals() {
    let play = Play::new(-0.4, 0.6).unwrap();
    let mut axis = certain(play, 0.15, PERIOD);
    let mut state: u64 = 2013;
    let mut reference = 0.0;
    axis.step(reference);
    for reversal in 0..100_000_u32 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        #[allow(clippy::cast_precision_loss)]
        let length = (state >> 40) as f64 / 16_777_216.0;
        let sign = if reversal % 2 == 0 { 1.0 } else { -1.0 };
        for _ in 0..3 {
            reference = (reference + sign * length / 3.0).clamp(-2.0, 2.0);
            axis.step(reference);
        }
        let lead = axis.command() - reference;
        assert!(lead.abs() < 0.6 + 2.0, "after {reversal} reversals: {lead}");
    }
    for _ in 0..4000 {
        reference += 0.002;
        axis.step(reference);
    }
    assert!((axis.command() - reference - 0.6).abs() < 1e-6);
}

/// Starting from nothing, a play is learnt from its output alone.
#[test]
fn a_play_is_learnt() {
    let truth = Play::new(-0.3, 0.5).unwrap();
    let mut axis = AdaptiveAxis::new(settings(0.15, PERIOD), Play::new(0.0, 0.0).unwrap()).unwrap();
    let mut tip = PlayState { output: 0.0 };
    for tick in 0..8000 {
        let reference = 2.0 * libm::sin(f64::from(tick) * core::f64::consts::TAU / 2000.0);
        let command = axis.step(reference);
        truth.step(&mut tip, command);
        if tick % 8 == 0 {
            axis.learn(command, tip.output, 0.01, core::iter::empty());
        }
        if tick > 4000 && tick % 1000 > 350 && tick % 1000 < 450 {
            assert!((tip.output - reference).abs() < 0.03, "tick {tick}");
        }
    }
    assert!((axis.play().delta_plus() - 0.5).abs() < 0.03);
    assert!((axis.play().delta_minus() + 0.3).abs() < 0.03);
}
