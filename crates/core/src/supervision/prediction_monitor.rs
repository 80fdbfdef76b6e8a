//! Prediction monitor: a tip that images find elsewhere than predicted.

use crate::dof::zip_with;

/// Time constant of the low-pass in s.
const TIME: f64 = 0.15;

/// Monitors the error of the predicted tip.
///
/// ```text
/// e <- e + (1 - exp(-t / 0.15 s)) (m - q - e),      |e| > limit
/// ```
///
/// with the measured tip m, its prediction q when the image was captured, and the time t since the last image, at most
/// 0.15 s: the slack has changed, the instrument was pushed, or images or commands are wrong (decision 0054).
///
/// Blind to a fault that moves the tip as slowly as the estimate follows. Beyond the limits without a fault, too, where the
/// prediction is poor: before the slack is known, and where the geometry is not as configured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictionMonitor<const N: usize> {
    limit: [f64; N],
    error: [f64; N],
    time: f64,
}

impl<const N: usize> PredictionMonitor<N> {
    /// The monitor before the first image, for limits of the low-passed error (N,) in units (N,) [m or rad].
    pub fn new(limit: [f64; N], unit: [f64; N]) -> Self {
        Self {
            limit: zip_with(limit, unit, |limit, unit| limit * unit),
            error: [0.0; N],
            time: f64::NAN,
        }
    }

    /// Update with an image captured at `time` in s: the tip predicted for it and the measured one (N,) [m or rad]. Whether
    /// an error is beyond its limit.
    pub fn update(&mut self, time: f64, predicted: [f64; N], measured: [f64; N]) -> bool {
        let passed = (time - self.time).clamp(0.0, TIME);
        let share = if passed.is_nan() {
            0.0
        } else {
            1.0 - libm::exp(-passed / TIME)
        };
        self.time = time;
        for (error, (measured, predicted)) in self
            .error
            .iter_mut()
            .zip(measured.into_iter().zip(predicted))
        {
            if measured.is_finite() && predicted.is_finite() {
                *error += share * (measured - predicted - *error);
            }
        }
        let mut errors = self.error.iter().zip(self.limit);
        errors.any(|(error, limit)| error.abs() > limit)
    }
}
