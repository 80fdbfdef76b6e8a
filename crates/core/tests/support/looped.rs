//! The whole loop of either profile, with all monitors.

// Every test takes of it what it needs.
#![allow(dead_code)]

use tautscope_core::{
    Best, Entry, FeatureModel, HysteresisReduction, Paper, Play, Profile, SafetySettings, Settings,
    history_entries,
};

use super::{UNITS, safety, settings};

/// A loop with its history on the heap.
pub type Loop<P> = HysteresisReduction<P, Vec<Entry>>;

/// Predicted features of the loop, and the ground truth of tests.
pub fn model() -> FeatureModel {
    settings(&safety()).feature_model().unwrap()
}

/// Profile `paper` that starts from the play that `play` gives for a unit.
pub fn article(play: impl Fn(f64) -> Play) -> Loop<Paper> {
    article_with(&safety(), 0.0, play)
}

/// [`article`] with these settings of the monitors, and the anchor's return.
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
    looped(&settings)
}

/// Profile `best`.
pub fn adaptive() -> Loop<Best> {
    adaptive_with(&safety(), 4.0)
}

/// [`adaptive`] with these settings of the monitors, and the distance from which a marker is an outlier.
pub fn adaptive_with(safety: &SafetySettings, outlier_distance: f64) -> Loop<Best> {
    let mut settings = settings(safety);
    settings.state_estimation.outlier_distance = outlier_distance;
    looped(&settings)
}

/// [`adaptive`] whose insertion and rotation have friction of their own.
pub fn adaptive_uncoupled() -> Loop<Best> {
    let mut settings = settings(&safety());
    settings.adaptive.one_friction = false;
    looped(&settings)
}

fn looped<P: Profile>(settings: &Settings) -> Loop<P> {
    let control = settings.control;
    let storage = vec![Entry::BLANK; history_entries(control.history, control.period)];
    HysteresisReduction::new(settings, storage).unwrap()
}
