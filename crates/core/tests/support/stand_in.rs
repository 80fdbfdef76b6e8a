//! A stand-in of three independent plays, and a hand that never repeats itself.

// Every test takes of it what it needs.
#![allow(dead_code)]

use tautscope_core::{FeatureModel, PerDof, Play, PlayState};

use super::UNITS;
use super::looped::model;

const HAND: [(f64, f64, f64); 3] = [(0.025, 15e-3, 7.5), (0.0, 1.2, 11.3), (0.9, 0.5, 17.9)];
/// Slack of the instrument, in [`UNITS`].
pub const WIDTH: f64 = 25.0;
/// Of markers, one way [px].
const NOISE: f64 = 0.2;

/// The reference at a time in s.
pub fn hand(time: f64) -> PerDof<f64> {
    HAND.map(|(centre, reach, period)| {
        centre + reach * (std::f64::consts::TAU * time / period).sin()
    })
}

/// Three plays that know nothing of each other, seen by an ideal camera.
pub struct World {
    play: PerDof<Play>,
    pub tip: PerDof<PlayState>,
    model: FeatureModel,
    chance: u64,
}

impl World {
    pub fn new() -> Self {
        Self {
            play: UNITS.map(|unit| Play::new(-0.4 * WIDTH * unit, 0.6 * WIDTH * unit).unwrap()),
            tip: HAND.map(|(output, _, _)| PlayState { output }),
            model: model(),
            chance: 2026,
        }
    }

    pub fn follow(&mut self, command: PerDof<f64>) {
        for ((play, tip), input) in self.play.iter().zip(&mut self.tip).zip(command) {
            play.step(tip, input);
        }
    }

    pub fn seen(&mut self) -> Option<[f64; 4]> {
        let truth = self.model.predict(self.tip.map(|tip| tip.output))?;
        Some(truth.features.map(|place| {
            self.chance ^= self.chance << 13;
            self.chance ^= self.chance >> 7;
            self.chance ^= self.chance << 17;
            let share = real(self.chance >> 11) / real(1 << 53);
            place + 2.0 * NOISE * (share - 0.5)
        }))
    }
}

#[expect(clippy::cast_precision_loss, reason = "below 2^53")]
pub fn real(count: u64) -> f64 {
    count as f64
}
