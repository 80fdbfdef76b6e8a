//! The control tick and the image update do not allocate: an allocation aborts this test.

// An allocator that aborts leaves the stack only.
#![allow(clippy::large_stack_arrays)]

mod support;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use support::UNITS;
use tautscope_core::{
    Axis, Camera, Compensator, Estimator, FeatureModel, Flag, Guards, History, HysteresisReduction,
    Instrument, PerDof, Play, Pose, Reaction, StateEstimation, StateEstimator, Status, Triggers,
    WeightedEstimator, WeightedSettings, Whereabouts, WhereaboutsSettings,
};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

fn article() -> PerDof<Axis> {
    let axis = |update_distance| {
        Axis::new(
            Compensator::new(5.0, 5.0).unwrap(),
            Estimator::new(update_distance, 0.4, 0.25).unwrap(),
            Play::new(0.0, 0.0).unwrap(),
        )
    };
    UNITS.map(axis)
}

fn adaptive() -> PerDof<Axis> {
    UNITS.map(|unit| Axis::Adaptive(support::axis(unit)))
}

fn weighted(outlier_distance: f64) -> StateEstimation {
    let watch = StateEstimator::new([1.0; 3]).unwrap();
    let settings = WeightedSettings {
        marker_deviation: 0.3,
        model_deviation: 0.3,
        sideways_deviation: 0.3e-3,
        outlier_distance,
        steps: 8,
    };
    StateEstimation::Weighted(WeightedEstimator::new(watch, settings).unwrap())
}

fn model() -> FeatureModel {
    let distortion = [-0.18, 0.05, 0.001, -0.001, -0.005, 0.0, 0.0, 0.0];
    FeatureModel::new(
        Instrument::new(18.5e-3, 5e-3, 15e-3, 1.75e-3, 4e-3).unwrap(),
        Camera::new([424.0, 454.0], [349.6, 285.0], distortion).unwrap(),
        Pose::new([9e-3, 7e-3, 8e-3], [0.29, -0.37, 0.0]).unwrap(),
    )
}

fn reduction(axes: PerDof<Axis>, estimation: StateEstimation) -> HysteresisReduction {
    HysteresisReduction::new(
        axes,
        model(),
        estimation,
        History::new(2.0, 0.005).unwrap(),
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

/// Over as many ticks as `TAUTSCOPE_TICKS` says, each loop at least once through every flag.
#[test]
fn step_and_image_update_do_not_allocate() {
    let wanted = std::env::var("TAUTSCOPE_TICKS");
    let wanted: u64 = wanted.map_or(0, |text| text.parse().unwrap());
    let mut ticks = 0;
    loop {
        ticks += run_article() + run_best(4.0) + run_best(f64::INFINITY);
        if ticks >= wanted {
            break;
        }
    }
    println!("G12 both {ticks} 0 0");
}

// Apart, so that the stack has one loop at a time.
fn run_article() -> u64 {
    let step = StateEstimation::Article(StateEstimator::new([1.0; 3]).unwrap());
    run(reduction(article(), step))
}

fn run_best(outlier_distance: f64) -> u64 {
    run(reduction(adaptive(), weighted(outlier_distance)))
}

/// How many ticks there were.
fn run(mut reduction: HysteresisReduction) -> u64 {
    let mut ticks = 1;
    let (mut used, mut learnt, mut worst) = (0, 0, Reaction::None);
    let truth = model();
    let posture = |time: f64| {
        let wave = time.sin();
        [0.025 + 0.01 * wave, wave, 0.9 + 0.5 * wave]
    };
    assert_no_alloc(|| {
        for tick in 0..4000_u32 {
            let time = f64::from(tick) * 0.005;
            reduction.step(posture(time), None, time);
            ticks += 1;
            if tick % 8 == 0 {
                let captured_at = time - 0.08;
                let seen = truth.predict(posture(captured_at - 0.3));
                let wrong = if tick % 80 == 0 { 300.0 } else { 0.0 };
                let measured = seen.map(|seen| {
                    let [ua, va, ub, vb] = seen.features;
                    [ua, va, ub + wrong, vb]
                });
                let report = reduction.on_features(measured, None, captured_at, None);
                used += u32::from(report.status == Status::Ok);
                learnt += u32::from(report.triggers.iter().any(Triggers::any));
            }
        }
        reduction.step([f64::NAN; 3], None, 20.0);
        reduction.on_features(None, None, 20.0, None);
        // Every flag, long enough for every rung of its ladder.
        for (flag, minute) in Flag::ALL.iter().zip(1_u32..) {
            reduction.guards_mut().engage();
            for tick in 0..2000_u32 {
                let time = 60.0 * f64::from(minute) + f64::from(tick) * 0.005;
                reduction.guards_mut().raise(*flag);
                reduction.step(posture(time), Some(time), time);
                ticks += 1;
                if tick % 8 == 0 {
                    let seen = truth.predict(posture(time)).map(|seen| seen.features);
                    reduction.on_features(seen, None, time, Some(u64::from(tick)));
                }
                worst = worst.max(reduction.guards().supervision().reaction);
            }
            reduction.guards_mut().acknowledge();
        }
    });
    assert_eq!(worst, Reaction::Disable);
    assert!(
        used > 400 && learnt > 40,
        "the whole path ran: {used} {learnt}"
    );
    ticks
}
