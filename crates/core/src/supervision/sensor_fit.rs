//! Fit of a sensor: whether what it measures agrees with its model.

/// Measurements of the mean.
const MEMORY: f64 = 50.0;
/// Largest weight of one measurement, over the mean, which so grows only if more than half of them are beyond it.
const LARGEST: f64 = 2.0;
/// Variance over the told one that is worth a warning.
const OFF: f64 = 9.0;

/// Estimates by how much a sensor errs more than told, from the values that no state explains.
///
/// ```text
/// s^2 <- s^2 + (min(m, 2 max(s^2, 1)) - s^2) / min(n, 50),     m = r' R^-1 r / (k - rank)
/// ```
///
/// with the residual r of the n-th measurement of k values in the state that fits it best, and their covariance R. A tracker
/// whose zero is off, and kinematics that are not those of the robot, contradict each measurement: with R max(s^2, 1) they
/// weigh less, in the told proportions. What is beyond that in less than half of the measurements remains an outlier.
///
/// Blind to errors that some state explains: to all, if the sensor has no more values than the DOFs need.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFit {
    count: f64,
    variance: f64,
}

impl SensorFit {
    /// Before the first measurement.
    pub const NEW: Self = Self {
        count: 0.0,
        variance: 1.0,
    };

    /// Updates with m of a measurement.
    pub fn update(&mut self, misfit: f64) {
        self.count = (self.count + 1.0).min(MEMORY);
        let misfit = misfit.min(LARGEST * self.scale());
        self.variance += (misfit - self.variance) / self.count;
    }

    /// Variance of the sensor over the told one, 1 at least.
    pub const fn scale(&self) -> f64 {
        self.variance.max(1.0)
    }

    /// Whether the sensor errs three times as much as told.
    pub fn is_off(&self) -> bool {
        self.variance > OFF
    }
}
