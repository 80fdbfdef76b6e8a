//! Filters of `tautscope.analysis.models` that take one step per measured tip.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{Table, Vector, same_length};
use crate::errors;

/// Filters that share a measurement row are computed side by side, as the processor's vectors do.
const LANES: usize = 6;
type Lanes = [f64; LANES];

/// Predict a signal by Kalman filters whose coefficients are random walks; they differ in their process noise.
///
/// ```text
/// y_k = r_k^T x_k + v_k,   v_k ~ N(0, noise^2),   x: independent random walks in the travel
/// ```
///
/// `rows` (n, p) are r; `travel` (n,) never decreases; `measured` (n,) is y, NaN where there is none. `mean` (p,) and
/// `variance` (p,) are those of x at the first measured sample; `growth` (k, p) is the variance that a travel of 1 adds, a
/// row per filter. Returns predictions r^T x (n, k), each from the samples before it; NaN up to the first measured one.
///
/// Raises `SignalError` for lengths that do not fit. A value that is not finite makes all later predictions NaN. The
/// covariance is updated without square roots: with `noise` below about 1e-7 of the prior's standard deviations it loses
/// its digits.
#[pyfunction]
#[pyo3(signature = (rows, travel, measured, *, mean, variance, growth, noise))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
pub fn track_coefficients<'py>(
    py: Python<'py>,
    rows: Table<'py>,
    travel: Vector<'py>,
    measured: Vector<'py>,
    mean: Vector<'py>,
    variance: Vector<'py>,
    growth: Table<'py>,
    noise: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (rows, growth) = (rows.as_array(), growth.as_array());
    let (travel, measured) = (travel.as_array(), measured.as_array());
    let (samples, size) = rows.dim();
    same_length(py, "travel", travel.len(), samples)?;
    same_length(py, "measured", measured.len(), samples)?;
    for (field, length) in [
        ("mean", mean.as_array().len()),
        ("variance", variance.as_array().len()),
        ("growth", growth.ncols()),
    ] {
        if length != size {
            return Err(errors::length(
                py,
                field,
                length,
                &format!("{size} values, one per coefficient"),
            ));
        }
    }
    let count = growth.nrows();
    let mut predicted = vec![f64::NAN; samples * count];
    let mut row = vec![0.0; size];
    for first in (0..count).step_by(LANES) {
        let lanes = LANES.min(count - first);
        let mut filters = Filters::new(mean.as_array().iter(), variance.as_array().iter());
        let walks: Vec<Lanes> = (0..size)
            .map(|i| std::array::from_fn(|lane| growth[[first + lane.min(lanes - 1), i]]))
            .collect();
        let mut last = None;
        for (k, tip) in measured.iter().enumerate() {
            for (value, item) in row.iter_mut().zip(rows.row(k)) {
                *value = *item;
            }
            let output = filters.predict(&row);
            if last.is_some() {
                let begin = k * count + first;
                predicted[begin..begin + lanes].copy_from_slice(&output[..lanes]);
            }
            if tip.is_finite() {
                filters.propagate(&walks, travel[k] - last.unwrap_or(travel[k]));
                filters.update(&row, &output.map(|output| tip - output), noise * noise);
                last = Some(travel[k]);
            }
        }
    }
    PyArray1::from_vec(py, predicted).reshape([samples, count])
}

/// Kalman filters with common measurement rows, one per lane.
struct Filters {
    state: Vec<Lanes>,
    /// Lower triangle of the covariance, row by row.
    covariance: Vec<Lanes>,
    /// Covariance times measurement row.
    projected: Vec<Lanes>,
}

impl Filters {
    fn new<'a>(
        mean: impl Iterator<Item = &'a f64>,
        variance: impl Iterator<Item = &'a f64>,
    ) -> Self {
        let state: Vec<Lanes> = mean.map(|value| [*value; LANES]).collect();
        let mut covariance = Vec::new();
        for (i, value) in variance.enumerate() {
            covariance.resize(covariance.len() + i, [0.0; LANES]);
            covariance.push([*value; LANES]);
        }
        let projected = vec![[0.0; LANES]; state.len()];
        Self {
            state,
            covariance,
            projected,
        }
    }

    fn predict(&self, row: &[f64]) -> Lanes {
        dot(&self.state, row)
    }

    fn propagate(&mut self, growth: &[Lanes], moved: f64) {
        let mut at = 0;
        for (i, growth) in growth.iter().enumerate() {
            at += i;
            for (entry, growth) in self.covariance[at].iter_mut().zip(growth) {
                *entry += growth * moved;
            }
            at += 1;
        }
    }

    fn update(&mut self, row: &[f64], innovation: &Lanes, noise: f64) {
        let mut rest = self.covariance.as_slice();
        for (i, value) in row.iter().enumerate() {
            let (left, [diagonal, ..]) = rest.split_at(i) else {
                return;
            };
            let (before, [own, ..]) = self.projected.split_at_mut(i) else {
                return;
            };
            *own = std::array::from_fn(|lane| diagonal[lane] * value);
            for ((entry, other), other_value) in left.iter().zip(before).zip(row) {
                for lane in 0..LANES {
                    own[lane] += entry[lane] * other_value;
                    other[lane] += entry[lane] * value;
                }
            }
            rest = &rest[i + 1..];
        }
        let variance = dot(&self.projected, row).map(|value| value + noise);
        let mut rest = self.covariance.as_mut_slice();
        for (i, state) in self.state.iter_mut().enumerate() {
            let weight: Lanes =
                std::array::from_fn(|lane| self.projected[i][lane] / variance[lane]);
            for lane in 0..LANES {
                state[lane] += weight[lane] * innovation[lane];
            }
            let (left, right) = rest.split_at_mut(i + 1);
            for (entry, projected) in left.iter_mut().zip(&self.projected) {
                for lane in 0..LANES {
                    entry[lane] -= weight[lane] * projected[lane];
                }
            }
            rest = right;
        }
    }
}

fn dot(lanes: &[Lanes], row: &[f64]) -> Lanes {
    let mut sum = [0.0; LANES];
    for (each, value) in lanes.iter().zip(row) {
        for lane in 0..LANES {
            sum[lane] += each[lane] * value;
        }
    }
    sum
}

/// Positions on a tabulated curve that a signal moves along at a constant speed, in the direction of its command.
///
/// ```text
/// direction_k = sign(c_k - c_(k-1)),   curve(direction_k p_k) = curve(direction_k p_(k-1)) + rate |c_k - c_(k-1)|
/// ```
///
/// `command` (n,) is c; `positions` (m,) and `curve` (m,), both increasing and at least one value, are the table, between
/// whose ends p stays; `start` is p before the first change. Returns p (n,). A sample that repeats the command repeats p. A segment in which the
/// command does not turn takes one conversion, so the sampling does not matter.
///
/// Raises `SignalError` if the lengths of the table differ, or if it is empty.
#[pyfunction]
#[pyo3(signature = (command, positions, curve, *, start, rate))]
pub fn move_along_curve<'py>(
    command: Vector<'py>,
    positions: Vector<'py>,
    curve: Vector<'py>,
    start: f64,
    rate: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let py = command.py();
    let (positions, curve) = (positions.as_array().to_vec(), curve.as_array().to_vec());
    same_length(py, "curve", curve.len(), positions.len())?;
    if curve.is_empty() {
        return Err(errors::length(py, "curve", 0, "at least one value"));
    }
    let (mut last, mut at) = (f64::NAN, start);
    let (mut begin, mut along, mut direction) = (0.0, 0.0, 0.0);
    let places = command.as_array().into_iter().map(|&now| {
        let turned = (now > last && direction <= 0.0) || (now < last && direction >= 0.0);
        if turned {
            direction = if now > last { 1.0 } else { -1.0 };
            begin = last;
            along = interpolate(direction * at, &positions, &curve);
        }
        if direction != 0.0 {
            at = direction * interpolate(along + rate * (now - begin).abs(), &curve, &positions);
        }
        last = now;
        at
    });
    Ok(PyArray1::from_vec(py, places.collect()))
}

/// Linear interpolation in a table with increasing x; the first or last y outside.
fn interpolate(x: f64, xs: &[f64], ys: &[f64]) -> f64 {
    let after = xs.partition_point(|each| *each <= x);
    if after == 0 || after == xs.len() {
        return ys[after.saturating_sub(1)];
    }
    let slope = (ys[after] - ys[after - 1]) / (xs[after] - xs[after - 1]);
    slope * (x - xs[after - 1]) + ys[after - 1]
}
