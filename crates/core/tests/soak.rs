//! Hours of work in one piece: nothing grows, nothing drifts. `TAUTSCOPE_HOURS` says how many; a few minutes without.
//!
//! Three degrees of freedom with play, a hand that never repeats itself, images every 40 ms.

// Three axes are more than the lint allows, and are moved once.
#![allow(clippy::large_stack_arrays)]

mod support;

use support::{PERIOD, UNITS};
use tautscope_core::{
    Axis, Camera, Compensator, Estimator, FeatureModel, Guards, History, HysteresisReduction,
    Instrument, PerDof, Play, PlayState, Pose, Reaction, StateEstimation, StateEstimator,
    WeightedEstimator, WeightedSettings, Whereabouts, WhereaboutsSettings,
};

const HAND: [(f64, f64, f64); 3] = [(0.025, 15e-3, 7.5), (0.0, 1.2, 11.3), (0.9, 0.5, 17.9)];
/// Slack of the instrument, in [`UNITS`].
const WIDTH: f64 = 25.0;
const TICKS_PER_FRAME: u64 = 8;

fn model() -> FeatureModel {
    FeatureModel::new(
        Instrument::new(18.5e-3, 5e-3, 15e-3, 1.75e-3, 4e-3).unwrap(),
        Camera::new([424.0, 454.0], [349.6, 285.0], [0.0; 8]).unwrap(),
        Pose::new([9e-3, 7e-3, 8e-3], [0.29, -0.37, 0.0]).unwrap(),
    )
}

fn looped(axes: PerDof<Axis>, estimation: StateEstimation) -> HysteresisReduction {
    HysteresisReduction::new(
        axes,
        model(),
        estimation,
        History::new(0.5, PERIOD).unwrap(),
        Whereabouts::new(WhereaboutsSettings {
            start_deviation: [5e-3, 0.6, 0.5],
            rest_deviation: [2e-4, 0.02, 0.01],
            settling_time: 0.15,
        })
        .unwrap(),
        Guards::new(support::guards()).unwrap(),
    )
    .with_friction(Some(support::friction()))
}

/// Resident memory in pages, and open files; none where the system does not say.
fn resources() -> Option<(u32, usize)> {
    let memory = std::fs::read_to_string("/proc/self/statm").ok()?;
    let files = std::fs::read_dir("/proc/self/fd").ok()?.count();
    Some((memory.split(' ').nth(1)?.parse().ok()?, files))
}

/// What grew or drifted, in words; nothing if nothing did.
fn soak(law: &str, mut reduction: HysteresisReduction) -> String {
    let hours = std::env::var("TAUTSCOPE_HOURS");
    let hours: f64 = hours.map_or(0.05, |text| text.parse().unwrap());
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive"
    )]
    let ticks = (hours * 3600.0 / PERIOD) as u64;
    let truth = model();
    let play = UNITS.map(|unit| Play::new(-0.4 * WIDTH * unit, 0.6 * WIDTH * unit).unwrap());
    let mut tip: PerDof<PlayState> = HAND.map(|(output, _, _)| PlayState { output });
    let (mut noise, mut late_error, mut early_error) = (2026_u64, 0.0_f64, 0.0_f64);
    let (mut before, mut worst) = (None, Reaction::None);
    for tick in 0..ticks {
        #[expect(clippy::cast_precision_loss, reason = "below 2^52")]
        let time = tick as f64 * PERIOD;
        let hand = HAND.map(|(centre, reach, period)| {
            centre + reach * (std::f64::consts::TAU * time / period).sin()
        });
        let command = reduction.step(hand, None, time);
        for ((play, tip), input) in play.iter().zip(&mut tip).zip(command) {
            play.step(tip, input);
        }
        if tick % TICKS_PER_FRAME == 0 {
            let seen = truth.predict(tip.map(|tip| tip.output)).map(|seen| {
                seen.features.map(|place| {
                    noise ^= noise << 13;
                    noise ^= noise >> 7;
                    noise ^= noise << 17;
                    #[expect(clippy::cast_precision_loss, reason = "53 bits")]
                    let share = (noise >> 11) as f64 / (1_u64 << 53) as f64;
                    place + 0.4 * (share - 0.5)
                })
            });
            reduction.on_features(seen, None, time, Some(tick));
        }
        worst = worst.max(reduction.guards().supervision().reaction);
        if tick == ticks / 10 {
            before = resources();
        }
        let [input, ..] = command;
        let error = (tip[0].output - hand[0]).abs();
        assert!(
            input.is_finite() && error < WIDTH * UNITS[0],
            "{law} {tick}"
        );
        if tick > 9 * (ticks / 10) {
            late_error += error;
        } else if tick > ticks / 10 && tick <= 2 * (ticks / 10) {
            early_error += error;
        }
    }
    let grown = match (before, resources()) {
        (Some((memory, files)), Some((more, now))) => files != now || 100 * more > 101 * memory,
        _ => false,
    };
    let drifted = late_error > 1.2 * early_error;
    let stopped = worst >= Reaction::HoldMotion;
    let broken = u64::from(grown) + u64::from(drifted) + u64::from(stopped);
    println!("G15 {law} {ticks} {broken} {}", late_error / early_error);
    if broken == 0 {
        return String::new();
    }
    format!(
        "{law}: more memory or files: {grown}, tip off by {early_error} m in all, later {late_error} m, {worst:?}. "
    )
}

fn paper() -> HysteresisReduction {
    let [insertion, rotation, bending] = UNITS;
    let axis = |unit: f64| {
        Axis::new(
            Compensator::new(5.0, 5.0).unwrap(),
            Estimator::new(3.0 * unit, 0.4, 0.25).unwrap(),
            Play::new(0.0, 0.0).unwrap(),
        )
    };
    let step = StateEstimation::Article(StateEstimator::new([1.0; 3]).unwrap());
    looped([axis(insertion), axis(rotation), axis(bending)], step)
}

fn best() -> HysteresisReduction {
    let settings = WeightedSettings {
        marker_deviation: 0.3,
        model_deviation: 0.3,
        sideways_deviation: 0.3e-3,
        outlier_distance: 4.0,
        steps: 8,
    };
    let watch = StateEstimator::new([1.0; 3]).unwrap();
    let estimation = StateEstimation::Weighted(WeightedEstimator::new(watch, settings).unwrap());
    let axes = UNITS.map(|unit| Axis::Adaptive(support::axis(unit)));
    looped(axes, estimation)
}

/// One after the other: files and memory are those of the process.
#[test]
fn nothing_grows_and_nothing_drifts() {
    let grown = soak("best", best()) + &soak("paper", paper());
    assert!(grown.is_empty(), "{grown}");
}
