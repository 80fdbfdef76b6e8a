//! The estimate of profile `best`, on ideal plays whose tip is measured directly.

use crate::article::play::{Play, PlayState};
use crate::article::play_limit::PlayLimit;
use crate::dof::Friction;
use crate::estimation::axis_filter::AxisFilter;
use crate::estimation::estimate::{Estimate, SlackDeviation};
use crate::estimation::measurement::Linear;
use crate::law::vector_law::{Bounds, VectorLaw};
use crate::model::plays::{COEFFICIENTS, GAIN_ROW, OFFSET, Plays, Transmission, product};
use crate::model::slack::{GAINS, Slack};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

use super::guarantees::Random;
use super::support::{safety, settings};
use super::{close, config};

/// Expected width of the slack, the unit of the DOF that it makes, and the standard deviation of the measured tip.
const EXPECTED: f64 = 8e-3;
const UNIT: f64 = 0.75 * EXPECTED;
const STD: f64 = 0.01 * UNIT;
const ORIGIN: f64 = 0.025;

/// An ideal play behind a gain: tip = origin + gain output.
struct Truth {
    play: Play,
    gain: f64,
    state: PlayState,
}

impl Truth {
    /// Half width, centre in units.
    fn new(half: f64, centre: f64, gain: f64) -> Self {
        let (half, centre) = (UNIT * half, UNIT * centre);
        Self {
            play: Play::new(centre - half, centre + half).unwrap(),
            gain,
            state: PlayState { output: -centre },
        }
    }

    fn step(&mut self, command: f64) -> f64 {
        ORIGIN + self.gain * self.play.step(&mut self.state, command - ORIGIN)
    }
}

/// The estimate of one DOF with measurements of its tip.
struct Direct {
    estimate: Estimate<1, 0, COEFFICIENTS>,
    plays: Plays<1>,
}

impl Direct {
    fn new() -> Self {
        let transmission = Transmission::new(Friction::independent(), [UNIT]).unwrap();
        let own = settings(&safety()).estimation;
        let estimate = Estimate::new(own, transmission, [], &[Slack::default()], [UNIT]);
        let mut estimate = estimate.unwrap();
        estimate.origin = [ORIGIN];
        Self {
            estimate,
            plays: Plays::REST,
        }
    }

    fn step(&mut self, command: f64) -> f64 {
        let to = [(command - ORIGIN) / UNIT];
        self.estimate.transmission.advance(&mut self.plays, &to);
        self.estimate.tip(&self.plays)[0]
    }

    fn update(&mut self, tip: f64, is_position_only: bool) {
        self.estimate.advance(self.plays.travel);
        let std = STD.hypot(self.estimate.noise()[0]);
        let measurement = Linear {
            by_state: SMatrix::from([[1.0 / std]]),
            by_geometry: SMatrix::zeros(),
            value: SVector::from([tip / std]),
        };
        self.estimate
            .update(&self.plays, &measurement, 0.0, is_position_only);
    }

    fn slack(&self) -> Slack {
        self.estimate.slack()[0]
    }

    fn deviation(&self) -> SlackDeviation {
        self.estimate.slack_deviation()[0]
    }
}

/// About normal, of standard deviation 1.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.within(-0.5, 0.5)).sum()
}

/// Commands on the way through random targets within 3 units.
fn commands(random: &mut Random, targets: u32) -> Vec<f64> {
    let (mut at, mut all) = (0.0, vec![]);
    for _ in 0..targets {
        let target: f64 = random.within(-3.0, 3.0);
        while at != target {
            at += (target - at).clamp(-0.06, 0.06);
            all.push(ORIGIN + UNIT * at);
        }
    }
    all
}

/// Images of a still scene err alike: thousands of them say little more than one.
#[test]
fn a_tip_that_is_measured_wrongly_at_rest_hardly_moves_the_estimate() {
    let (mut truth, mut random) = (Truth::new(0.7, 0.0, 1.0), Random(11));
    let mut direct = Direct::new();
    let (mut command, mut tip) = (ORIGIN, ORIGIN);
    for to in commands(&mut random, 30) {
        command = to;
        tip = truth.step(command);
        direct.step(command);
        direct.update(tip, false);
    }
    let before = direct.step(command);
    for _ in 0..3000 {
        direct.step(command);
        direct.update(tip + 0.1 * UNIT, false);
    }
    let moved = (direct.step(command) - before) / UNIT;
    assert!((0.0..0.03).contains(&moved), "{moved} of 0.1 units");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..config() })]

    #[test]
    fn an_ideal_play_is_learnt_within_three_standard_deviations(
        half in 0.35..1.0_f64, centre in -0.3..0.3_f64, gain in 0.7..1.3_f64, seed in 1..u64::MAX,
    ) {
        let (mut truth, mut random) = (Truth::new(half, centre, gain), Random(seed));
        let (mut direct, mut filter) = (Direct::new(), AxisFilter::new(settings(&safety()).estimation, EXPECTED, STD).unwrap());
        filter.step(ORIGIN);
        for (count, command) in commands(&mut random, 60).into_iter().enumerate() {
            let tip = truth.step(command);
            let predicted = direct.step(command);
            prop_assert!((filter.step(command) - predicted).abs() <= 1e-9 * UNIT);
            if count % 4 == 0 {
                let measured = tip + STD * normal(&mut random);
                direct.update(measured, false);
                filter.update(measured);
            }
        }
        let (slack, deviation) = (direct.slack(), direct.deviation());
        let off = [slack.half_width - UNIT * half, slack.gain - gain, slack.centre - UNIT * centre];
        prop_assert!(off[0].abs() <= 3.0 * deviation.half_width, "{slack:?} {off:?}");
        prop_assert!(off[1].abs() <= 3.0 * deviation.gain, "{slack:?} {off:?}");
        let std = deviation.half_width.hypot(UNIT * deviation.gain);
        prop_assert!(off[2].abs() <= 3.0 * std, "{slack:?} {off:?}");
        prop_assert!((filter.gain() - slack.gain).abs() <= 1e-9);
        prop_assert!((filter.play().width() - 2.0 * slack.half_width).abs() <= 1e-9 * UNIT);
        // What is predicted without images.
        for command in commands(&mut random, 5) {
            let (tip, predicted) = (truth.step(command), direct.step(command));
            let mut ahead = direct.estimate.clone();
            ahead.advance(direct.plays.travel);
            let std = ahead.prior(&direct.plays).covariance[0].sqrt();
            prop_assert!((predicted - tip).abs() <= 3.0 * std, "{predicted} {tip} {std}");
        }
    }

    /// Mean of command less tip over the gain, of strokes in both directions.
    #[test]
    fn the_centre_is_that_of_the_predicted_contact_offsets(gain in 0.7..1.3_f64, centre in -0.3..0.3_f64, seed in 1..u64::MAX) {
        let (mut truth, mut random, mut direct) = (Truth::new(0.6, centre, gain), Random(seed), Direct::new());
        for (count, command) in commands(&mut random, 30).into_iter().enumerate() {
            let tip = truth.step(command);
            direct.step(command);
            if count % 8 == 0 {
                direct.update(tip, false);
            }
        }
        let (slack, mut sum) = (direct.slack(), 0.0);
        for side in [-1.0, 1.0] {
            direct.step(ORIGIN + 4.0 * side * UNIT);
            for part in -10..=10 {
                let command = ORIGIN - 0.1 * f64::from(part) * side * UNIT;
                let tip = direct.step(command);
                sum += (command - ORIGIN - (tip - ORIGIN) / slack.gain) / 42.0;
            }
        }
        prop_assert!((slack.centre - sum).abs() <= 0.04 * UNIT, "{slack:?} {sum}");
    }

    /// The weights stay to the last bit.
    #[test]
    fn an_update_of_the_position_changes_the_offset_alone(seed in 1..u64::MAX, push in -1.0..1.0_f64) {
        let (mut truth, mut random, mut direct) = (Truth::new(0.6, 0.1, 0.9), Random(seed), Direct::new());
        for (count, command) in commands(&mut random, 6).into_iter().enumerate() {
            let tip = truth.step(command);
            direct.step(command);
            if count % 8 == 0 {
                direct.update(tip, false);
            }
        }
        direct.estimate.advance(direct.plays.travel);
        let [before] = direct.estimate.coefficients();
        let tip = direct.estimate.tip(&direct.plays)[0] + push * UNIT;
        direct.update(tip, true);
        let [after] = direct.estimate.coefficients();
        for (index, (before, after)) in before.iter().zip(&after).enumerate() {
            if index == OFFSET {
                let step = (after - before) / push;
                prop_assert!((-1e-6..=1.0 + 1e-6).contains(&step), "{step}");
            } else {
                prop_assert_eq!(before, after);
            }
        }
    }

    /// Whatever is measured.
    #[test]
    fn the_gain_stays_within_its_bounds(tips in prop::collection::vec((-3.0..3.0_f64, -100.0..100.0_f64), 1..60)) {
        let mut direct = Direct::new();
        for (command, tip) in tips {
            direct.step(ORIGIN + UNIT * command);
            direct.update(ORIGIN + UNIT * tip, false);
            let gain = product(&GAIN_ROW, &direct.estimate.coefficients()[0]);
            let (least, most) = GAINS;
            prop_assert!((least - 1e-9..=most + 1e-9).contains(&gain), "{gain}");
            prop_assert!(direct.slack().half_width >= 0.0);
        }
    }
}

/// However long nothing is measured, an offset gets no less certain than it may.
#[test]
fn an_offset_is_loosened_up_to_a_limit() {
    let mut direct = Direct::new();
    // At rest in the origin the tip is hardly more than the offset.
    let std = |direct: &Direct| {
        let [noise] = direct.estimate.noise();
        let variance = direct.estimate.prior(&Plays::REST).covariance.trace();
        (variance - noise * noise).sqrt() / UNIT
    };
    let mut loosened = |std_in_units: f64, most: f64| {
        for _ in 0..10_000 {
            let std = [std_in_units * UNIT];
            direct.estimate.loosen(std, [most * UNIT]);
        }
        std(&direct)
    };
    assert!((1.5..1.52).contains(&loosened(0.03, 1.5)));
    // What is less certain already stays.
    let wide = loosened(0.03, f64::INFINITY);
    assert!(wide > 3.0 && close(loosened(0.03, 1.5), wide));
}

/// Initial offsets far beyond the expected width still make a tip.
#[test]
fn the_tip_is_finite_for_any_start() {
    for half_width in [0.0, 1e-6, 1.0, 9.0, 1e3, 1e9] {
        let transmission = Transmission::new(Friction::independent(), [UNIT]).unwrap();
        let own = settings(&safety()).estimation;
        let start = Slack {
            half_width: half_width * UNIT,
            ..Slack::default()
        };
        let made = Estimate::<1, 0, COEFFICIENTS>::new(own, transmission, [], &[start], [UNIT]);
        let mut estimate = made.unwrap();
        estimate.origin = [ORIGIN];
        let [tip] = estimate.tip(&Plays::REST);
        assert!(tip.is_finite(), "{half_width}: {tip}");
    }
}

#[test]
fn a_tip_or_command_that_is_not_finite_changes_nothing() {
    let mut filter = AxisFilter::new(settings(&safety()).estimation, EXPECTED, STD).unwrap();
    filter.update(1.0);
    filter.step(ORIGIN);
    let before = filter.clone();
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        filter.update(wrong);
        filter.step(wrong);
        assert_eq!(filter, before);
    }
}

/// Control ticks; without optimization one takes 20 times as long.
fn ticks() -> u32 {
    if cfg!(debug_assertions) {
        20_000
    } else {
        1_000_000
    }
}

/// RMS error of a compensated tip in tenths of a run, in units.
fn soak(truth: Truth, ticks: u32, mut reference: impl FnMut(u32) -> f64) -> [f64; 10] {
    let (mut truth, mut random) = (truth, Random(2013));
    let mut direct = Direct::new();
    let bounds = Bounds {
        width_limit: [2.0 * UNIT],
        speed: [40.0 * UNIT],
        period: 0.005,
        input_age: 0.05,
        offsets: [PlayLimit::new(3.0 * UNIT, 2.0 * UNIT).unwrap()],
    };
    let own = settings(&safety()).law;
    let mut law = VectorLaw::new(own, direct.estimate.transmission, &bounds).unwrap();
    let (mut errors, tenth) = ([0.0; 10], ticks / 10);
    for tick in 0..ticks {
        let to = ORIGIN + UNIT * reference(tick);
        let rows = direct.estimate.coefficients();
        let command = law.propose([to], &rows, 1.0);
        law.commit(command);
        let tip = truth.step(command[0]);
        direct.step(command[0]);
        if tick % 16 == 0 {
            direct.update(tip + STD * normal(&mut random), false);
        }
        let error = (tip - to) / UNIT;
        errors[usize::try_from(tick / tenth).unwrap()] += error * error / f64::from(tenth);
    }
    errors.map(f64::sqrt)
}

fn check_soak(errors: [f64; 10]) {
    println!("{errors:.4?}");
    assert!(errors[9] <= 1.15 * errors[1], "{errors:?}");
}

/// As from its middle: after half a stroke it does not matter any more.
#[test]
fn a_start_at_an_end_of_the_slack_does_not_last() {
    for side in [-1.0, 1.0] {
        let mut truth = Truth::new(0.6, 0.0, 1.0);
        truth.state.output = 0.6 * side * UNIT;
        let errors = soak(truth, 4000, |tick| 4.0 * (0.0045 * f64::from(tick)).sin());
        assert!(
            errors[4..].iter().all(|error| *error < 0.06),
            "{errors:.3?}"
        );
    }
}

/// Strokes shorter than the slack excite few directions of the coefficients; the others may not drift.
#[test]
fn short_strokes_do_not_let_the_estimate_drift() {
    for (half, centre, amplitude) in [(0.8, 0.15, 0.6), (0.55, -0.1, 0.25)] {
        check_soak(soak(Truth::new(half, centre, 1.0), ticks(), |tick| {
            amplitude * (0.02 * f64::from(tick)).sin()
        }));
    }
}

#[test]
fn short_moves_to_random_targets_do_not_let_the_estimate_drift() {
    let (mut random, mut at, mut target) = (Random(7), 0.0, 0.0_f64);
    check_soak(soak(Truth::new(0.8, 0.15, 1.0), ticks(), |_| {
        if at == target {
            target = random.within(-0.6, 0.6);
        }
        at += (target - at).clamp(-0.01, 0.01);
        at
    }));
}
