//! Properties of the blocks, checked on generated input; the generator's seed is fixed.

// Where these compare floats for equality, equality to the last bit is what they claim.
#![allow(clippy::float_cmp)]

mod any_dofs;
mod camera;
mod command_limiter;
mod compensator;
mod discarded_motion;
mod estimate;
mod estimator;
mod expectation;
mod fading;
mod features;
mod flags;
mod frame_rate;
mod frames;
mod guarantees;
mod history;
mod hysteresis;
mod image_updates;
mod input_device;
mod instrument;
mod kalman;
mod law;
mod limits;
mod linear;
mod measurement;
mod monitors;
mod motion_bounds;
mod motion_monitor;
mod outline;
mod play;
mod plays;
mod prediction_monitor;
mod readings;
mod recovery;
mod reference_gate;
mod reference_speed;
mod section;
mod slide;
mod start_check;
mod state;
mod stress;
mod strokes;
mod supervised_law;
mod supervisor;
#[path = "../support/mod.rs"]
mod support;
mod turning_points;
mod whole;

use crate::article::play::Play;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 256,
        rng_seed: RngSeed::Fixed(2013),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Contact offsets of any sign, with a width from 0 up.
fn plays() -> impl Strategy<Value = Play> {
    (-2.0..2.0, prop_oneof![Just(0.0), 0.0..3.0])
        .prop_map(|(minus, width)| Play::new(minus, minus + width).unwrap())
}

/// Where a signal turns round.
fn turning_points() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-5.0..5.0, 2..20)
}

/// The path through the turning points, `steps` samples from each to the next.
fn path(turning_points: &[f64], steps: u32) -> Vec<f64> {
    let mut samples = vec![turning_points[0]];
    for pair in turning_points.windows(2) {
        samples.extend((1..=steps).map(|step| {
            let share = f64::from(step) / f64::from(steps);
            pair[0] + share * (pair[1] - pair[0])
        }));
    }
    samples
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12
}
