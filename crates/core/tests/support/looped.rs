//! The whole loop of either profile, with every guard.

// Every test takes of it what it needs.
#![allow(dead_code)]

use tautscope_core::{
    Axis, Camera, Compensator, Estimator, FeatureModel, History, HysteresisReduction, Instrument,
    Monitors, PerDof, Play, Pose, SafetySettings, StateEstimation, StateEstimator,
    WeightedEstimator, WeightedSettings, Whereabouts, WhereaboutsSettings,
};

use super::{PERIOD, UNITS, dofs, safety};

/// What the loop believes of instrument and camera, and what tests take for the truth.
pub fn model() -> FeatureModel {
    let distortion = [-0.18, 0.05, 0.001, -0.001, -0.005, 0.0, 0.0, 0.0];
    FeatureModel::new(
        Instrument::new(18.5e-3, 5e-3, 15e-3, 1.75e-3, 4e-3).unwrap(),
        Camera::new([424.0, 454.0], [349.6, 285.0], distortion).unwrap(),
        Pose::new([9e-3, 7e-3, 8e-3], [0.29, -0.37, 0.0]).unwrap(),
    )
}

/// The article's scheme, from the slack that `play` gives for a unit.
pub fn article(play: impl Fn(f64) -> Play) -> Box<HysteresisReduction> {
    article_with(&safety(), 0.0, play)
}

/// The same with other monitors and the anchor's return.
pub fn article_with(
    settings: &SafetySettings,
    recovery: f64,
    play: impl Fn(f64) -> Play,
) -> Box<HysteresisReduction> {
    let axes = UNITS.map(|unit| {
        Axis::new(
            Compensator::new(5.0, 5.0)
                .and_then(|law| law.with_recovery(recovery))
                .unwrap(),
            Estimator::new(unit, 0.4, 0.25).unwrap(),
            play(unit),
        )
    });
    looped(settings, axes, StateEstimation::Article(watch()))
}

/// Profile `best`.
pub fn adaptive() -> Box<HysteresisReduction> {
    adaptive_with(&safety(), 4.0)
}

/// The same with other monitors, and other ideas of what one marker may say.
pub fn adaptive_with(settings: &SafetySettings, outlier_distance: f64) -> Box<HysteresisReduction> {
    let axes = UNITS.map(|unit| Axis::Adaptive(super::axis(unit)));
    let weights = WeightedSettings {
        marker_deviation: 0.3,
        model_deviation: 0.3,
        sideways_deviation: 0.3e-3,
        outlier_distance,
        steps: 8,
    };
    let estimator = WeightedEstimator::new(watch(), weights).unwrap();
    looped(settings, axes, StateEstimation::Weighted(estimator))
}

fn watch() -> StateEstimator {
    StateEstimator::new([1.0; 3]).unwrap()
}

fn looped(
    settings: &SafetySettings,
    axes: PerDof<Axis>,
    estimation: StateEstimation,
) -> Box<HysteresisReduction> {
    Box::new(
        HysteresisReduction::new(
            axes,
            model(),
            estimation,
            History::new(2.0, PERIOD).unwrap(),
            Whereabouts::new(WhereaboutsSettings {
                start_deviation: [5e-3, 0.6, 0.5],
                rest_deviation: [2e-4, 0.02, 0.01],
                settling_time: 0.15,
            })
            .unwrap(),
            Monitors::new(settings, &dofs(), PERIOD).unwrap(),
        )
        .with_friction(Some(super::friction())),
    )
}
