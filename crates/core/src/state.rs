//! The state estimate from one image, Eqs. (13)-(16), and which DOF the image says nothing about.

use crate::dof::{PerDof, all_finite};
use crate::error::{ConfigError, require_positive};
use crate::features::FeaturePrediction;

type Column = [f64; 4];

/// One linear step from prediction to measurement, Eqs. (13)-(16), with its rank watched.
///
/// ```text
/// q_hat = q + pinv(L) (s_measured - s_predicted)
/// deviation_j = sqrt(((L' L)^-1)_jj)       standard deviation of DOF j per px of marker noise
/// ```
///
/// with the interaction matrix L (4, 3). While a DOF's deviation exceeds its
/// `observable_deviation`, the worst (as a ratio, so that m and rad compare) is held at its
/// prediction and the rest is solved for again: rotation, for example, near zero bend.
///
/// Wrong far from the prediction: the step is linear and there is one of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateEstimator {
    observable_deviation: PerDof<f64>,
}

/// What one image says about the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateEstimate {
    /// `q_hat` [m, rad, rad]; a DOF that is not observable has its prediction here.
    pub state: PerDof<f64>,
    /// Which DOFs the image determined.
    pub observable: PerDof<bool>,
    /// Standard deviation per px of marker noise [m/px, rad/px]; for a held DOF that for which it
    /// was held.
    pub deviation: PerDof<f64>,
    /// `s_measured - s_predicted` in px.
    pub innovation: [f64; 4],
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

    /// The state estimate for measured features (4,) in px, from the predicted state and what the
    /// model predicts for it. With anything not finite, no DOF is observable.
    pub fn estimate(
        &self,
        predicted_state: PerDof<f64>,
        prediction: &FeaturePrediction,
        measured_features: [f64; 4],
    ) -> StateEstimate {
        let innovation = subtract(measured_features, prediction.features);
        let [insertion, rotation, bending] = prediction.columns;
        let [insertion_unit, rotation_unit, bending_unit] = self.observable_deviation;
        let finite = all_finite(innovation)
            && all_finite(predicted_state)
            && prediction.columns.iter().all(|column| all_finite(*column));

        // In units of the largest deviation allowed, "observable" is "at most one".
        let mut axes = [
            Unknown::new(insertion, insertion_unit, finite),
            Unknown::new(rotation, rotation_unit, finite),
            Unknown::new(bending, bending_unit, finite),
        ];
        while finite && solve_and_hold_worst(&mut axes, innovation) {}

        let [insertion, rotation, bending] = axes;
        let [q1, q2, q3] = predicted_state;
        StateEstimate {
            state: [
                q1 + insertion.correction(),
                q2 + rotation.correction(),
                q3 + bending.correction(),
            ],
            observable: [insertion.active, rotation.active, bending.active],
            deviation: [
                insertion.ratio * insertion_unit,
                rotation.ratio * rotation_unit,
                bending.ratio * bending_unit,
            ],
            innovation,
        }
    }
}

/// A DOF being solved for.
#[derive(Clone, Copy)]
struct Unknown {
    column: Column,
    unit: f64,
    active: bool,
    /// Deviation over `observable_deviation`.
    ratio: f64,
    /// In `unit`.
    solution: f64,
}

impl Unknown {
    fn new(column: Column, unit: f64, active: bool) -> Self {
        Self {
            column: column.map(|value| value * unit),
            unit,
            active,
            ratio: f64::INFINITY,
            solution: 0.0,
        }
    }

    fn correction(&self) -> f64 {
        if self.active {
            self.solution * self.unit
        } else {
            0.0
        }
    }

    /// Least squares for this DOF: with r the part of its column that no other column explains,
    /// the solution is r e / r r and the deviation 1 / |r|.
    fn solve(&mut self, others: [&Self; 2], innovation: Column) {
        let [first, second] =
            others.map(|other| if other.active { other.column } else { [0.0; 4] });
        let second = without(second, first);
        // Twice: what rounding left of the other columns goes with the second pass.
        let own = without(without(self.column, first), second);
        let own = without(without(own, first), second);
        let square = dot(own, own);
        self.solution = dot(own, innovation) / square;
        self.ratio = if square.is_finite() && self.solution.is_finite() {
            1.0 / libm::sqrt(square)
        } else {
            f64::INFINITY
        };
    }
}

/// Solve for the active DOFs; hold the least observable one and say so if it is not observable.
fn solve_and_hold_worst(axes: &mut [Unknown; 3], innovation: Column) -> bool {
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
    let worst = axes
        .iter_mut()
        .filter(|axis| axis.active && axis.ratio > 1.0)
        .max_by(|a, b| a.ratio.total_cmp(&b.ratio));
    worst.is_some_and(|axis| {
        axis.active = false;
        true
    })
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
