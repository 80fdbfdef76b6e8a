//! The regression of the tip on its plays.

#![expect(clippy::needless_range_loop, reason = "as matrices are written")]

use crate::estimation::marker_measurement::TipMeasurement;
use crate::estimation::tip_regression::{
    ALIKE, CONSTANT, CONSTANT_WALK, GAIN_WALK, GEOMETRY_WALK, LONGEST, PlayReading, SLOPE,
    TipRegression,
};
use proptest::prelude::*;

use super::config;

const UNIT: [f64; 3] = [6e-3, 1.3, 0.75];
const ORIGIN: [f64; 3] = [0.03, 0.2, 0.6];
const LATE: [f64; 3] = [1e-4, -0.02, 0.01];
const GAIN: f64 = 0.2;
const GEOMETRY: [f64; 3] = [0.4, 6.0, 8.0];

/// Gain - 1, b, c of each DOF, and geometry.
type Truth = [f64; 12];

fn initial() -> Truth {
    let [a, b, c] = GEOMETRY;
    let ([g, s, k], mut std) = ([GAIN, SLOPE, CONSTANT], [0.0; 12]);
    std.copy_from_slice(&[g, g, g, s, s, s, k, k, k, a, b, c]);
    std
}

/// The columns of a measurement, with the tip in units of the DOFs.
fn columns(by_tip: [f64; 3], by_geometry: [f64; 3], reading: &PlayReading) -> Truth {
    let mut columns = [0.0; 12];
    for dof in 0..3 {
        let by = by_tip[dof] * UNIT[dof];
        columns[dof] = by * reading.output[dof];
        columns[3 + dof] = by * reading.deflection[dof];
        columns[6 + dof] = by;
        columns[9 + dof] = by_geometry[dof];
    }
    columns
}

fn measurement(
    by_tip: [f64; 3],
    by_geometry: [f64; 3],
    reading: &PlayReading,
    truth: &Truth,
    noise: f64,
) -> TipMeasurement {
    let columns = columns(by_tip, by_geometry, reading);
    let off: f64 = columns.iter().zip(truth).map(|(a, b)| a * b).sum();
    let on: f64 = (0..3)
        .map(|dof| by_tip[dof] * (ORIGIN[dof] + UNIT[dof] * reading.output[dof] - LATE[dof]))
        .sum();
    TipMeasurement {
        by_tip,
        by_geometry,
        value: on + off + noise,
    }
}

/// x in A x = b, by Gaussian elimination; the right side is the last entry of each row.
fn solve(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let size = rows.len();
    for pivot in 0..size {
        let best = (pivot..size)
            .max_by(|a, b| rows[*a][pivot].abs().total_cmp(&rows[*b][pivot].abs()))
            .unwrap();
        rows.swap(pivot, best);
        for row in 0..size {
            if row != pivot {
                let factor = rows[row][pivot] / rows[pivot][pivot];
                for column in pivot..=size {
                    rows[row][column] -= factor * rows[pivot][column];
                }
            }
        }
    }
    (0..size)
        .map(|row| rows[row][size] / rows[row][row])
        .collect()
}

fn three(most: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-most..most)
}

proptest! {
    #![proptest_config(config())]

    /// The estimate is the end of the path of coefficients that minimises the squares of its start, of its steps and of the misfits,
    /// all in their standard deviations, solved at once.
    #[test]
    fn the_estimate_is_that_of_least_squares(
        readings in prop::collection::vec((three(1.0), three(1.0)), 2..5),
        rows in prop::collection::vec((three(3.0), three(0.5), -1.0..1.0_f64), 4),
        truth in prop::array::uniform12(-0.5..0.5_f64),
    ) {
        let std = initial();
        let truth: Truth = core::array::from_fn(|index| truth[index] * std[index]);
        let mut regression = TipRegression::new(GAIN, GEOMETRY);
        let count = readings.len();
        let size = 12 * count;
        let mut normal = vec![vec![0.0; size + 1]; size];
        for index in 0..12 {
            normal[index][index] += 1.0 / std[index].powi(2);
        }
        let mut last: Option<[f64; 3]> = None;
        for (image, (output, deflection)) in readings.iter().enumerate() {
            let reading = PlayReading { output: *output, deflection: *deflection };
            let travel = last.map_or(0.0, |last| (0..3).map(|dof| (output[dof] - last[dof]).abs()).sum::<f64>());
            last = Some(*output);
            let mut walk = [0.0; 12];
            for dof in 0..3 {
                walk[dof] = GAIN_WALK.powi(2);
                walk[6 + dof] = CONSTANT_WALK.powi(2);
                walk[9 + dof] = (GEOMETRY_WALK * GEOMETRY[dof]).powi(2);
            }
            if image > 0 {
                for index in 0..12 {
                    // What does not walk is tied together.
                    let weight = 1.0 / (walk[index] * travel).max(1e-9);
                    let (before, now) = (12 * (image - 1) + index, 12 * image + index);
                    normal[before][before] += weight;
                    normal[now][now] += weight;
                    normal[before][now] -= weight;
                    normal[now][before] -= weight;
                }
            }
            let measurements: Vec<_> = rows.iter().map(|(by_tip, by_geometry, noise)| {
                let by_tip = [0, 1, 2].map(|dof| by_tip[dof] / UNIT[dof]);
                measurement(by_tip, *by_geometry, &reading, &truth, *noise)
            }).collect();
            regression.update(&measurements, &reading, LATE, UNIT, ORIGIN);
            if image > 0 {
                let weight = travel.min(LONGEST) / ALIKE;
                for (by_tip, by_geometry, noise) in &rows {
                    let by_tip = [0, 1, 2].map(|dof| by_tip[dof] / UNIT[dof]);
                    let columns = columns(by_tip, *by_geometry, &reading);
                    let value = columns.iter().zip(truth).map(|(a, b)| a * b).sum::<f64>() + noise;
                    for a in 0..12 {
                        for b in 0..12 {
                            normal[12 * image + a][12 * image + b] += weight * columns[a] * columns[b];
                        }
                        normal[12 * image + a][size] += weight * columns[a] * value;
                    }
                }
            }
        }
        let solution = solve(normal);
        let end = &solution[size - 12..];
        let (geometry, _) = regression.geometry();
        for dof in 0..3 {
            prop_assert!((regression.gain()[dof] - 1.0 - end[dof]).abs() <= 1e-5, "{dof}: {:?} {end:?}", regression.gain());
            prop_assert!((geometry[dof] - end[9 + dof]).abs() <= 1e-5 * GEOMETRY[dof], "{dof}: {geometry:?} {end:?}");
        }
    }

    /// Images at rest say nothing, however many; nothing is measured before the first motion.
    #[test]
    fn images_at_rest_say_nothing(output in three(1.0), truth in prop::array::uniform12(-1.0..1.0_f64)) {
        let reading = PlayReading { output, deflection: [0.5; 3] };
        let mut regression = TipRegression::new(GAIN, GEOMETRY);
        let new = regression.geometry();
        let row = measurement([100.0, 2.0, 3.0], [1.0, 2.0, 3.0], &reading, &truth, 0.0);
        for _ in 0..20 {
            regression.update(&[row], &reading, LATE, UNIT, ORIGIN);
        }
        prop_assert_eq!(regression.gain(), [1.0; 3]);
        prop_assert_eq!(regression.geometry(), new);
    }
}

/// A tip that was pushed is elsewhere: with its constants forgotten, the push is neither a gain nor a geometry.
#[test]
fn a_push_is_no_geometry() {
    let truth = [
        0.1, -0.1, 0.05, 0.0, 0.0, 0.0, 0.1, 0.0, -0.1, 0.3, 3.0, -5.0,
    ];
    let wander = |regression: &mut TipRegression, truth: &Truth, steps: core::ops::Range<u32>| {
        for step in steps {
            let phase = 0.1 * f64::from(step);
            let output = [phase.sin(), (1.7 * phase).sin(), (0.6 * phase).cos()];
            let reading = PlayReading {
                output,
                deflection: output.map(|x| 0.3 * x * x),
            };
            let rows = [0_u8, 1, 2, 3].map(|row| {
                let dof = usize::from(row % 3);
                let mut by_tip = [0.0; 3];
                by_tip[dof] = 20.0 / UNIT[dof];
                let row = f64::from(row);
                let geometry = [
                    8.0 * (phase + row).cos(),
                    (0.3 * phase + row).sin(),
                    (0.7 * phase - row).cos(),
                ];
                measurement(by_tip, geometry, &reading, truth, 0.0)
            });
            regression.update(&rows, &reading, LATE, UNIT, ORIGIN);
        }
    };
    let off = |regression: &TipRegression| {
        let (geometry, _) = regression.geometry();
        (0..3)
            .map(|dof| ((geometry[dof] - truth[9 + dof]) / GEOMETRY[dof]).abs())
            .fold(0.0, f64::max)
    };
    let mut regression = TipRegression::new(GAIN, GEOMETRY);
    assert!(off(&regression) > 0.5);
    wander(&mut regression, &truth, 0..400);
    assert!(off(&regression) < 0.05, "{}", off(&regression));
    let mut pushed = truth;
    pushed[6] += 1.0;
    let mut known = regression.clone();
    known.forget_constants();
    wander(&mut known, &pushed, 400..410);
    wander(&mut regression, &pushed, 400..410);
    assert!(off(&known) < 0.05, "{}", off(&known));
    assert!(
        off(&regression) > 2.0 * off(&known),
        "{} {}",
        off(&regression),
        off(&known)
    );
}
