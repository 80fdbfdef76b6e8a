//! The whole loop of Fig. 6 on a simulated instrument: three plays in the images of an ideal camera with 80 ms latency.
//!
//! ```sh
//! cargo run --package tautscope-config --example whole_loop [rig.toml]
//! ```
//!
//! It prints the RMS distance of the tip from the reference, without and with compensation.

use std::error::Error;
use std::f64::consts::TAU;

use tautscope_config::Configuration;
use tautscope_core::{BandLoop, Best, Entry, HysteresisReduction, Play, PlayState, Settings};

/// Widths of the plays: Table 1 of the article [m, rad, rad].
const WIDTHS: [f64; 3] = [10e-3, 1.8, 1.1];
/// Centre, amplitude and period in s of the reference of each DOF.
const REFERENCE: [(f64, f64, f64); 3] = [(25e-3, 15e-3, 20.0), (0.0, 1.5, 23.0), (0.9, 0.6, 17.0)];
const DURATION: f64 = 70.0;
/// From when on the error counts [s]; before that the offsets are estimated.
const COUNTED_FROM: f64 = 40.0;
const TICKS_PER_FRAME: u32 = 8;
const LATENCY: f64 = 0.08;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1);
    let text = path.map_or_else(|| Ok(String::new()), std::fs::read_to_string)?;
    let [without, with] = tracking_errors(&text)?;
    let units = [
        ("insertion", "mm", 1e3),
        ("rotation", "rad", 1.0),
        ("bending", "rad", 1.0),
    ];
    for ((name, unit, scale), (without, with)) in units.iter().zip(without.into_iter().zip(with)) {
        println!(
            "{name}: {:.3} {unit} without, {:.3} {unit} with",
            scale * without,
            scale * with
        );
    }
    Ok(())
}

/// RMS distances (3,) without and with compensation.
fn tracking_errors(toml: &str) -> Result<[[f64; 3]; 2], Box<dyn Error>> {
    let settings: Settings = Configuration::parse(toml)?.read()?;
    let mut bare = settings;
    bare.law.free_gain = 1.0;
    Ok([tracking_error(&bare)?, tracking_error(&settings)?])
}

/// RMS distance (3,) of the tip from the reference [m, rad, rad].
fn tracking_error(settings: &Settings) -> Result<[f64; 3], Box<dyn Error>> {
    let control = settings.control;
    let storage = vec![Entry::BLANK; settings.history_entries()];
    let mut reduction = HysteresisReduction::<Best, _>::new(settings, storage)?;
    let model = settings.feature_model()?;
    let mut plays = Vec::new();
    for width in WIDTHS {
        plays.push((
            Play::new(-width / 2.0, width / 2.0)?,
            PlayState { output: 0.0 },
        ));
    }
    let (mut squares, mut counted) = ([0.0; 3], 0.0);
    let mut seen = Vec::new();
    for tick in 0_u32.. {
        let time = f64::from(tick) * control.period;
        if time >= DURATION {
            break;
        }
        let reference = REFERENCE
            .map(|(centre, amplitude, period)| centre + amplitude * (TAU * time / period).sin());
        let command = reduction.step(reference, None, time);
        let mut tip = [0.0; 3];
        for ((play, state), (tip, command)) in plays.iter_mut().zip(tip.iter_mut().zip(command)) {
            *tip = play.step(state, command);
        }
        if tick % TICKS_PER_FRAME == 0 {
            seen.push((
                time,
                model.predict(tip).map(|prediction| prediction.features),
            ));
        }
        // A frame arrives when its latency is over.
        while let Some(&(captured_at, features)) = seen.first()
            && time - captured_at >= LATENCY
        {
            reduction.on_features(features, None, captured_at, None);
            seen.remove(0);
        }
        if time >= COUNTED_FROM {
            counted += 1.0;
            for (square, (tip, reference)) in squares.iter_mut().zip(tip.into_iter().zip(reference))
            {
                *square += (tip - reference) * (tip - reference);
            }
        }
    }
    Ok(squares.map(|square| (square / counted).sqrt()))
}

#[test]
fn compensation_takes_most_of_the_error() {
    let [without, with] = tracking_errors("").unwrap();
    for (without, with) in without.into_iter().zip(with) {
        assert!(with < 0.15 * without, "{with} with, {without} without");
    }
}
