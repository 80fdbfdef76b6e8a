//! The state estimate from one image, Eqs. (13)-(16), and which DOFs the image does not determine.

use crate::dof::{PerDof, all_finite, zip_with};
use crate::error::{ConfigError, require_positive};
use crate::model::features::FeaturePrediction;

type Column = [f64; 4];

/// One linear step from prediction to measurement, Eqs. (13)-(16), with a check of its rank.
///
/// ```text
/// q_hat = q + pinv(L) (s_measured - s_predicted)
/// deviation_j = sqrt(((L' L)^-1)_jj)       standard deviation (std) of DOF j per px of marker noise
/// ```
///
/// with the interaction matrix L (4, 3). While the std of a DOF exceeds its
/// `observable_deviation`, one such DOF is held at its prediction, the one without which the rest
/// is best determined (by the worst ratio of the two, so that m and rad compare), and the rest is solved
/// for again: rotation, for example, near zero bend.
///
/// The two rows of L of a band that was not found are left out, so that at least one DOF is held.
///
/// Wrong far from the prediction: the step is linear and there is one of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateEstimator {
    observable_deviation: PerDof<f64>,
}

/// The state estimate from one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateEstimate {
    /// `q_hat` [m, rad, rad]; a DOF that is not observable has its prediction here.
    pub state: PerDof<f64>,
    /// Which DOFs the image determined.
    pub observable: PerDof<bool>,
    /// Standard deviation per px of marker noise [m/px, rad/px]; for a held DOF the value for which it
    /// was held.
    pub deviation: PerDof<f64>,
    /// `s_measured - s_predicted` in px; NaN for a band that was not found.
    pub innovation: [f64; 4],
    /// pinv(L) as it was used, one row per DOF [m/px, rad/px]; zeros for a DOF that was held.
    pub inverse: PerDof<[f64; 4]>,
}

impl StateEstimate {
    /// Standard deviations (3,) [m, rad, rad] of the state estimate from the covariance (4, 4) of the features
    /// in px^2: `sqrt((pinv(L) covariance pinv(L)')_jj)`. NaN for a DOF that was held.
    ///
    /// The step is not weighted with the covariance, Eq. (16), so that a weighted estimate has smaller ones. The error
    /// of a held DOF is not included.
    pub fn state_deviation(&self, covariance: &[[f64; 4]; 4]) -> PerDof<f64> {
        let mut deviations = [f64::NAN; 3];
        let rows = self.inverse.iter().zip(self.observable);
        for (deviation, (row, observable)) in deviations.iter_mut().zip(rows) {
            if observable {
                let each = covariance.iter().zip(row).filter(|(_, own)| **own != 0.0);
                let variance: f64 = each
                    .map(|(line, own)| {
                        let used = line.iter().zip(row).filter(|(_, other)| **other != 0.0);
                        own * used.map(|(entry, other)| entry * other).sum::<f64>()
                    })
                    .sum();
                *deviation = libm::sqrt(variance);
            }
        }
        deviations
    }
}

impl StateEstimator {
    /// An estimator that holds a DOF beyond `observable_deviation` (3,) [m/px, rad/px].
    ///
    /// # Errors
    /// A value is not a finite number above 0.
    pub fn new(observable_deviation: PerDof<f64>) -> Result<Self, ConfigError> {
        for value in observable_deviation {
            require_positive("observable_deviation", value)?;
        }
        Ok(Self {
            observable_deviation,
        })
    }

    /// The state estimate from measured features (4,) in px, the predicted state and the features predicted for it.
    ///
    /// Two NaN mark a band that was not found. With any other value that is not finite, no DOF is observable.
    pub fn estimate(
        &self,
        predicted_state: PerDof<f64>,
        prediction: &FeaturePrediction,
        measured_features: [f64; 4],
    ) -> StateEstimate {
        let innovation = subtract(measured_features, prediction.features);
        let found = found(measured_features);
        let masked = |column: Column| mask(found, column);
        let [insertion, rotation, bending] = prediction.columns.map(masked);
        let [insertion_unit, rotation_unit, bending_unit] = self.observable_deviation;
        let step = masked(innovation);
        let finite = all_finite(step)
            && all_finite(predicted_state)
            && prediction.columns.iter().all(|column| all_finite(*column));

        // In units of the largest std allowed, a DOF is observable up to 1.
        let mut axes = [
            Unknown::new(insertion, insertion_unit, finite),
            Unknown::new(rotation, rotation_unit, finite),
            Unknown::new(bending, bending_unit, finite),
        ];
        while finite && solve_and_hold_one(&mut axes, step) {}

        StateEstimate {
            state: zip_with(predicted_state, axes, |q, axis| q + axis.correction()),
            observable: axes.map(|axis| axis.active),
            deviation: axes.map(|axis| axis.ratio * axis.unit),
            innovation,
            inverse: axes.map(|axis| axis.row()),
        }
    }
}

/// Whether each band was found: two NaN mark one that was not.
pub fn found([ua, va, ub, vb]: [f64; 4]) -> [bool; 2] {
    [!(ua.is_nan() && va.is_nan()), !(ub.is_nan() && vb.is_nan())]
}

/// Replaces the entries of a band that was not found by zeros.
fn mask([a, b]: [bool; 2], [ua, va, ub, vb]: Column) -> Column {
    let part = |found: bool, u: f64, v: f64| if found { (u, v) } else { (0.0, 0.0) };
    let ((ua, va), (ub, vb)) = (part(a, ua, va), part(b, ub, vb));
    [ua, va, ub, vb]
}

/// A DOF being solved for.
#[derive(Clone, Copy)]
struct Unknown {
    column: Column,
    unit: f64,
    active: bool,
    /// Standard deviation over `observable_deviation`.
    ratio: f64,
    /// In `unit`.
    solution: f64,
    /// Its row of the pseudo-inverse, in `unit`.
    inverse: Column,
}

impl Unknown {
    fn new(column: Column, unit: f64, active: bool) -> Self {
        Self {
            column: column.map(|value| value * unit),
            unit,
            active,
            ratio: f64::INFINITY,
            solution: 0.0,
            inverse: [0.0; 4],
        }
    }

    fn correction(&self) -> f64 {
        if self.active {
            self.solution * self.unit
        } else {
            0.0
        }
    }

    fn row(&self) -> Column {
        if self.active {
            self.inverse.map(|value| value * self.unit)
        } else {
            [0.0; 4]
        }
    }

    /// Least squares for this DOF: with r the part of its column that no other column explains,
    /// the solution is r e / r r and the standard deviation 1 / |r|.
    fn solve(&mut self, others: [&Self; 2], innovation: Column) {
        let [first, second] =
            others.map(|other| if other.active { other.column } else { [0.0; 4] });
        let second = without(second, first);
        // Twice: the second pass removes what rounding left of the other columns.
        let own = without(without(self.column, first), second);
        let own = without(without(own, first), second);
        let square = dot(own, own);
        self.solution = dot(own, innovation) / square;
        self.inverse = own.map(|value| value / square);
        self.ratio = if square.is_finite() && self.solution.is_finite() {
            1.0 / libm::sqrt(square)
        } else {
            f64::INFINITY
        };
    }
}

/// Solves for the active DOFs and holds one that is not observable; returns whether there was one.
fn solve_and_hold_one(axes: &mut [Unknown; 3], innovation: Column) -> bool {
    solve(axes, innovation);
    let mut best: Option<(f64, [Unknown; 3])> = None;
    for index in 0..axes.len() {
        let mut trial = *axes;
        let Some(axis) = trial
            .get_mut(index)
            .filter(|axis| axis.active && axis.ratio > 1.0)
        else {
            continue;
        };
        axis.active = false;
        solve(&mut trial, innovation);
        let active = trial.iter().filter(|axis| axis.active);
        let worst = active.map(|axis| axis.ratio).fold(0.0, f64::max);
        if best.is_none_or(|(least, _)| worst < least) {
            best = Some((worst, trial));
        }
    }
    best.is_some_and(|(_, held)| {
        *axes = held;
        true
    })
}

fn solve(axes: &mut [Unknown; 3], innovation: Column) {
    let [first, second, third] = axes;
    if first.active {
        first.solve([second, third], innovation);
    }
    if second.active {
        second.solve([third, first], innovation);
    }
    if third.active {
        third.solve([first, second], innovation);
    }
}

fn dot([a0, a1, a2, a3]: Column, [b0, b1, b2, b3]: Column) -> f64 {
    a0 * b0 + a1 * b1 + a2 * b2 + a3 * b3
}

fn subtract([a0, a1, a2, a3]: Column, [b0, b1, b2, b3]: Column) -> Column {
    [a0 - b0, a1 - b1, a2 - b2, a3 - b3]
}

/// `vector` without its part along `direction`.
fn without(vector: Column, direction: Column) -> Column {
    let square = dot(direction, direction);
    if square == 0.0 {
        return vector;
    }
    let share = dot(vector, direction) / square;
    subtract(vector, direction.map(|value| share * value))
}
