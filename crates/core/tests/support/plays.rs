//! A simulated instrument of three independent plays, and a reference that does not repeat.

// No test uses all of it.
#![allow(dead_code)]

use tautscope_core::{FeatureModel, Play, PlayState};

use super::UNITS;
use super::loops::model;

/// Centre, amplitude and period in s of the reference of each DOF.
const SINES: [(f64, f64, f64); 3] = [(0.025, 15e-3, 7.5), (0.0, 1.2, 11.3), (0.9, 0.5, 17.9)];
/// Width of the plays, in [`UNITS`].
pub const WIDTH: f64 = 25.0;
/// Largest error of a marker's coordinate [px].
const NOISE: f64 = 0.2;

/// The reference at a time in s.
pub fn reference(time: f64) -> [f64; 3] {
    SINES.map(|(centre, amplitude, period)| {
        centre + amplitude * (std::f64::consts::TAU * time / period).sin()
    })
}

/// Three independent plays in the images of an ideal camera with noise.
pub struct ThreePlays {
    play: [Play; 3],
    pub tip: [PlayState; 3],
    model: FeatureModel,
    random: u64,
}

impl ThreePlays {
    pub fn new() -> Self {
        Self {
            play: UNITS.map(|unit| Play::new(-0.4 * WIDTH * unit, 0.6 * WIDTH * unit).unwrap()),
            tip: SINES.map(|(output, _, _)| PlayState { output }),
            model: model(),
            random: 2026,
        }
    }

    /// The tips follow the command (3,) [m, rad, rad].
    pub fn step(&mut self, command: [f64; 3]) {
        for ((play, tip), input) in self.play.iter().zip(&mut self.tip).zip(command) {
            play.step(tip, input);
        }
    }

    /// Measured features (4,) in px.
    pub fn measure(&mut self) -> Option<[f64; 4]> {
        let truth = self.model.predict(self.tip.map(|tip| tip.output))?;
        Some(truth.features.map(|place| {
            self.random ^= self.random << 13;
            self.random ^= self.random >> 7;
            self.random ^= self.random << 17;
            let share = real(self.random >> 11) / real(1 << 53);
            place + 2.0 * NOISE * (share - 0.5)
        }))
    }
}

#[expect(clippy::cast_precision_loss, reason = "below 2^53")]
pub fn real(count: u64) -> f64 {
    count as f64
}
