//! Direction in which the operator moves the tip, without the tremor.

use crate::adaptive::smoother::Smoother;
use crate::dof::PerDof;

/// Direction w of the intended motion: a string of length `travel` (3,) that the smoothed reference pulls.
///
/// Of insertion and rotation it is a vector play of the motion of the shaft's surface, (du1, r du2), of bending a
/// play: rate independent, and unchanged by what stays within `travel`. A reversal turns it within a travel of
/// `travel`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlipDirection {
    radius: f64,
    travel: PerDof<f64>,
    smoothers: PerDof<Smoother>,
    intended: Option<PerDof<f64>>,
    string: PerDof<f64>,
}

impl SlipDirection {
    /// At rest, for a shaft of a radius in m; `travel` in [m, m, rad], of which the first is that of the surface;
    /// `time` and `period` in s as of [`Smoother`].
    pub fn new(radius: f64, travel: PerDof<f64>, time: f64, period: f64) -> Self {
        Self {
            radius,
            travel,
            smoothers: [Smoother::new(time, period); 3],
            intended: None,
            string: [0.0; 3],
        }
    }

    /// Follows the next reference (3,) [m, rad, rad].
    pub fn step(&mut self, reference: PerDof<f64>) {
        let mut smooth = reference;
        for (value, smoother) in smooth.iter_mut().zip(&mut self.smoothers) {
            *value = smoother.step(*value);
        }
        let [u1, u2, u3] = smooth;
        let [l1, l2, l3] = self.intended.replace(smooth).unwrap_or(smooth);
        let [s1, s2, s3] = self.string;
        let [most, _, bending] = self.travel;
        let (a, b) = (s1 + (u1 - l1), s2 + self.radius * (u2 - l2));
        let length = libm::sqrt(a * a + b * b);
        let kept = if length > most { most / length } else { 1.0 };
        let third = (s3 + (u3 - l3)).max(-bending).min(bending);
        self.string = [kept * a, kept * b, third];
    }

    /// The direction (3,): |(w1, w2)| is 1 or 0, w3 has the sign of the motion of bending or is 0.
    pub fn value(&self) -> PerDof<f64> {
        let [a, b, third] = self.string;
        let length = libm::sqrt(a * a + b * b);
        if length > 0.0 {
            [a / length, b / length, third]
        } else {
            [0.0, 0.0, third]
        }
    }

    /// Counts the reference from elsewhere by `shift` (3,).
    pub fn shift(&mut self, shift: PerDof<f64>) {
        for (smoother, shift) in self.smoothers.iter_mut().zip(shift) {
            smoother.shift(shift);
        }
        if let Some(intended) = &mut self.intended {
            for (value, shift) in intended.iter_mut().zip(shift) {
                *value += shift;
            }
        }
    }
}
