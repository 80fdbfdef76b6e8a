//! Loops of all profiles, with all monitors.

// No test uses all of it.
#![allow(dead_code)]

use tautscope_core::{
    BandProfile, Best, Entry, FeatureModel, HysteresisReduction, Paper, Play, SafetySettings,
    Settings,
};

use super::{UNITS, open_loop, safety, settings};

/// A loop with its history on the heap.
pub type Loop<P> = HysteresisReduction<P, Vec<Entry>>;

/// The feature model of the loops; it also gives the true features in tests.
pub fn model() -> FeatureModel {
    settings(&safety()).feature_model().unwrap()
}

/// Profile `paper`; `play` gives the initial estimate of a DOF from its unit.
pub fn article(play: impl Fn(f64) -> Play) -> Loop<Paper> {
    article_with(&open_loop(), 0.0, play)
}

/// [`article`] with other settings of the monitors and another `recovery`.
pub fn article_with(
    safety: &SafetySettings,
    recovery: f64,
    play: impl Fn(f64) -> Play,
) -> Loop<Paper> {
    let mut settings = settings(safety);
    let dofs = [
        &mut settings.insertion,
        &mut settings.rotation,
        &mut settings.bending,
    ];
    for (dof, unit) in dofs.into_iter().zip(UNITS) {
        let play = play(unit);
        dof.recovery = recovery;
        (dof.delta_minus, dof.delta_plus) = (play.delta_minus(), play.delta_plus());
    }
    build(&settings)
}

/// Profile `best`.
pub fn best() -> Loop<Best> {
    best_with(&open_loop(), 4.0)
}

/// [`best`] with other settings of the monitors and another Mahalanobis distance of outliers.
pub fn best_with(safety: &SafetySettings, outlier_distance: f64) -> Loop<Best> {
    let mut settings = settings(safety);
    settings.estimation.outlier_distance = outlier_distance;
    build(&settings)
}

fn build<P: BandProfile>(settings: &Settings) -> Loop<P> {
    let storage = vec![Entry::BLANK; settings.history_entries()];
    HysteresisReduction::new(settings, storage).unwrap()
}
