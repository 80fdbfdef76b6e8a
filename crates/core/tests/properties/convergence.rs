//! The filter on simulated plays of known widths, centres, share and gain; equal inputs give equal filters.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::estimation::filter::Filter;
use crate::estimation::marker_measurement::TipMeasurement;
use crate::math::random::Normal;
use crate::model::hysteresis::{Hysteresis, PlayPosition};

use super::support::{dofs, safety, settings};

const UNIT: PerDof<f64> = [6e-3, 1.3, 0.75];
const RADIUS: f64 = 1.75e-3;
const NOISE: PerDof<f64> = [0.2e-3, 0.015, 0.015];
/// Standard deviation that the loop assumes of the tip from the plays: `tip_deviation` of the defaults.
const STD: PerDof<f64> = [0.48e-3, 0.104, 0.06];

fn new_filter() -> Filter {
    let none = Play::new(0.0, 0.0).unwrap();
    let start = dofs().map(|dof| dof.start_deviation);
    Filter::new(
        settings(&safety()).state_estimation,
        UNIT,
        start,
        [none; 3],
        RADIUS,
    )
    .unwrap()
}

/// Sines of incommensurate periods.
fn command(time: f64) -> PerDof<f64> {
    [
        0.025 + 15e-3 * (0.63 * time).sin(),
        2.0 * (0.86 * time).sin(),
        0.9 + 0.9 * (0.73 * time).sin(),
    ]
}

/// A filter after so many s on an instrument of that hysteresis, and the RMS error of its tip over the last half.
fn run(truth: &Hysteresis, seconds: u32, seed: u64) -> (Filter, PerDof<f64>) {
    let (filter, error, _) = run_with(truth, seconds, seed, |_| 0.0);
    (filter, error)
}

/// The same where the tip deviates from the plays by a function of time, in `UNIT`; with the error of a prediction without it.
fn run_with(
    truth: &Hysteresis,
    seconds: u32,
    seed: u64,
    deviation: impl Fn(f64) -> f64,
) -> (Filter, PerDof<f64>, PerDof<f64>) {
    let (mut filter, mut noise) = (new_filter(), Normal::new(seed));
    let mut last = command(0.0);
    filter.start(last, last);
    let mut position = truth.propagate(RADIUS, &PlayPosition::at(last), last, last);
    let (mut squares, mut alone, mut count) = ([0.0; 3], [0.0; 3], 0.0);
    for tick in 1..seconds * 200 {
        let time = 0.005 * f64::from(tick);
        let next = command(time);
        position = truth.propagate(RADIUS, &position, last, next);
        filter.step(last, next, 0.005);
        last = next;
        let mut tip = position.output;
        for (tip, unit) in tip.iter_mut().zip(UNIT) {
            *tip += unit * deviation(time);
        }
        if tick > seconds * 100 {
            count += 1.0;
            let output = filter.nominal().position.output;
            let found = filter.nominal().tip(output);
            for dof in 0..3 {
                let off = found[dof] - tip[dof];
                squares[dof] += off.powi(2);
                alone[dof] += (off - filter.nominal().residual[dof]).powi(2);
            }
        }
        if tick % 8 == 0 {
            filter.follow(core::iter::once((next, next)));
            let seen = [0, 1, 2].map(|dof| tip[dof] + NOISE[dof] * noise.draw());
            let rows = [0, 1, 2].map(|dof| {
                let mut by_tip = [0.0; 3];
                by_tip[dof] = 1.0 / STD[dof];
                TipMeasurement {
                    by_tip,
                    by_geometry: [0.0; 3],
                    value: seen[dof] / STD[dof],
                }
            });
            filter.update_with(&rows, seen, false);
        }
    }
    let rms = |squares: PerDof<f64>| squares.map(|square| (square / count).sqrt());
    (filter, rms(squares), rms(alone))
}

fn truths() -> [Hysteresis; 4] {
    let usual = Hysteresis {
        half_width: [4e-3, 0.8, 0.5],
        centre: [0.4e-3, -0.1, 0.05],
        shared: 0.97,
    };
    [
        usual,
        Hysteresis {
            shared: 0.02,
            ..usual
        },
        Hysteresis {
            half_width: [2.5e-3, 1.1, 0.3],
            ..usual
        },
        Hysteresis {
            half_width: [5.5e-3, 0.5, 0.7],
            centre: [-0.8e-3, 0.1, -0.1],
            ..usual
        },
    ]
}

#[test]
fn widths_centres_and_share_of_known_plays_are_found() {
    for (index, truth) in truths().iter().enumerate() {
        let (filter, error) = run(truth, 60, 2026);
        let found = filter.nominal().hysteresis;
        println!("{index}: {found:?} {error:?}");
        for dof in 0..3 {
            let wide = (found.half_width[dof] / truth.half_width[dof]).ln();
            let std = filter.nominal().width_std[dof];
            // As certain as the random walk lets it be, and not more certain than it is right.
            assert!(
                wide.abs() < 4.0 * std && std < 0.12,
                "{index}, {dof}: half width off by {wide}, std {std}"
            );
            let centre = filter.centre(filter.nominal().position.output)[dof];
            let off = (centre - truth.centre[dof]) / truth.half_width[dof];
            assert!(off.abs() < 0.2, "{index}, {dof}: centre off by {off}");
            assert!(
                error[dof] < STD[dof] / 2.0,
                "{index}, {dof}: tip off by {}",
                error[dof]
            );
        }
        let share = (found.shared - truth.shared).abs();
        assert!(
            share < 0.25,
            "{index}: share {} for {}",
            found.shared,
            truth.shared
        );
    }
}

/// A deviation of 0.2 mm, 0.05 and 0.03 rad in 4 s, which widths and centres cannot follow.
#[test]
fn the_prediction_follows_a_deviation_of_the_tip_that_lasts() {
    let truth = &truths()[0];
    let (_, error, alone) = run_with(truth, 60, 2026, |time| 0.035 * (1.57 * time).sin());
    println!("{error:?} {alone:?}");
    // The noise of insertion is as large as its deviation.
    for (dof, most) in [1.2, 0.7, 0.7].into_iter().enumerate() {
        assert!(error[dof] < most * alone[dof], "{dof}: {error:?} {alone:?}");
    }
}

/// Neither wrong images nor an image that only shows the position make it large.
#[test]
fn the_residual_is_bounded() {
    let (mut filter, start) = (new_filter(), command(0.0));
    filter.start(start, start);
    let far = start.map(|value| value + 10.0);
    filter.update_with(&[], far, true);
    assert_eq!(filter.nominal().residual, [0.0; 3]);
    for _ in 0..5 {
        filter.update_with(&[], far, false);
    }
    for (found, unit) in filter.nominal().residual.into_iter().zip(UNIT) {
        assert!((found - 0.04 * unit).abs() < 1e-12, "{found}");
    }
    filter.reset_position();
    filter.update_with(&[], start, false);
    for (found, unit) in filter.nominal().residual.into_iter().zip(UNIT) {
        assert!(found.abs() < 0.04 * unit, "{found}");
    }
}

/// Bit for bit: the same seed of the members, and no clock and no address in them.
#[test]
fn filters_with_equal_inputs_are_equal() {
    let [truth, ..] = truths();
    let ((one, _), (other, _)) = (run(&truth, 5, 3), run(&truth, 5, 3));
    assert!(one == other);
    let (third, _) = run(&truth, 5, 4);
    assert!(one != third);
}
