//! Gain of each DOF and error of the geometry, by regression of the measured tip on plays.

use crate::dof::PerDof;
use crate::estimation::marker_measurement::TipMeasurement;
use crate::math::linear::square;
use crate::model::features::GEOMETRY;

/// Bounds of the gain.
const LEAST_GAIN: f64 = 0.5;
const LARGEST_GAIN: f64 = 1.5;
/// Bound of the unevenness, above which the section would bend to both sides.
const LARGEST_UNEVENNESS: f64 = 1.0;
/// Initial standard deviations of b and c.
pub const SLOPE: f64 = 0.3;
pub const CONSTANT: f64 = 0.5;
/// Standard deviations of random walks over a travel of 1: of the gain, of c, and of the geometry in its initial standard
/// deviations.
pub const GAIN_WALK: f64 = 0.01;
pub const CONSTANT_WALK: f64 = 0.03;
pub const GEOMETRY_WALK: f64 = 0.02;
/// Travel within which the tip deviates from the plays alike: images within it count as one.
pub const ALIKE: f64 = 4.0;
/// Longest travel that one image stands for: after motion without an image the next one may be wrong.
pub const LONGEST: f64 = 0.25;
/// Standard deviations of an innovation from which on it counts no more.
const LARGEST_INNOVATION: f64 = 2.0;

/// Gain - 1, b and c of each DOF, and the geometry.
const COEFFICIENTS: usize = 9 + GEOMETRY;
type Coefficients = [f64; COEFFICIENTS];

/// Outputs and deflections of plays that no image corrects (3,), in units of the DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlayReading {
    /// Output x, from the first reference.
    pub output: PerDof<f64>,
    /// Deflection d: command less output.
    pub deflection: PerDof<f64>,
}

/// Linear regression of the measured tip on the plays, with one error of the geometry for all DOFs.
///
/// ```text
/// tip_i = gain_i x_i + b_i d_i + c_i        by the markers, as a geometry with the error e has it
/// ```
///
/// for DOF i, by the Kalman filter of a random walk of all coefficients. Images within a travel of 4 count as one.
///
/// A wrong geometry shows as a tip that moves with another DOF: only the plays tell it from a motion, because one image has
/// the same tip elsewhere. A half width that is wrong moves the two sides of the loop apart, by a share of the deflection: b
/// takes it. Without b, a loop that is narrower than its estimate has the larger travel, and the difference would pass for a
/// gain.
///
/// Wrong while motion stays within a few slack widths, by the initial deviations; and by friction that grows with the speed,
/// where the speed depends on the position.
#[derive(Debug, Clone, PartialEq)]
pub struct TipRegression {
    mean: Coefficients,
    covariance: [Coefficients; COEFFICIENTS],
    walk: Coefficients,
    /// Last output; None before it.
    last: Option<PerDof<f64>>,
}

impl TipRegression {
    /// Nothing measured: gains of 1 and no error of the geometry, of these standard deviations.
    pub fn new(gain: f64, geometry: [f64; GEOMETRY]) -> Self {
        let [unevenness, u, v] = geometry;
        let std = |own: [f64; 3]| {
            let ([a, b, c], [g1, g2, g3]) = (own, geometry);
            [a, a, a, b, b, b, c, c, c, g1, g2, g3].map(square)
        };
        let mut covariance = [[0.0; COEFFICIENTS]; COEFFICIENTS];
        let initial = std([gain, SLOPE, CONSTANT]);
        for (index, (row, variance)) in covariance.iter_mut().zip(initial).enumerate() {
            if let Some(entry) = row.get_mut(index) {
                *entry = variance;
            }
        }
        let mut walk = std([GAIN_WALK, 0.0, CONSTANT_WALK]);
        let [.., w1, w2, w3] = &mut walk;
        [*w1, *w2, *w3] = [unevenness, u, v].map(|std| square(GEOMETRY_WALK * std));
        Self {
            mean: [0.0; COEFFICIENTS],
            covariance,
            walk,
            last: None,
        }
    }

    /// Update with an image of the tip, whose plays lagged behind by `late` (3,), for units (3,) of the DOFs and positions
    /// from `origin` (3,) [m, rad, rad].
    pub fn update(
        &mut self,
        measurements: &[TipMeasurement],
        reading: &PlayReading,
        late: PerDof<f64>,
        unit: PerDof<f64>,
        origin: PerDof<f64>,
    ) {
        let before = self.last.replace(reading.output).unwrap_or(reading.output);
        let moved = before.into_iter().zip(reading.output);
        let travel: f64 = moved.map(|(before, after)| (after - before).abs()).sum();
        if travel == 0.0 {
            return;
        }
        for (index, (row, walk)) in self.covariance.iter_mut().zip(self.walk).enumerate() {
            if let Some(entry) = row.get_mut(index) {
                *entry += walk * travel;
            }
        }
        let variance = ALIKE / travel.min(LONGEST);
        for measurement in measurements {
            let [s1, s2, s3] = scaled(measurement.by_tip, unit);
            let ([x1, x2, x3], [d1, d2, d3]) = (reading.output, reading.deflection);
            let [g1, g2, g3] = measurement.by_geometry;
            let columns = [
                s1 * x1,
                s2 * x2,
                s3 * x3,
                s1 * d1,
                s2 * d2,
                s3 * d3,
                s1,
                s2,
                s3,
                g1,
                g2,
                g3,
            ];
            let parts = measurement.by_tip.into_iter().zip(origin).zip(late);
            let known: f64 = parts.map(|((by, origin), late)| by * (origin - late)).sum();
            let value = measurement.value - known - s1 * x1 - s2 * x2 - s3 * x3;
            self.update_once(&columns, value, variance);
        }
    }

    fn update_once(&mut self, columns: &Coefficients, value: f64, variance: f64) {
        let cross = self.covariance.map(|row| product(&row, columns));
        let own = product(&cross, columns);
        let innovation = value - product(&self.mean, columns);
        let usual = libm::sqrt(own + 1.0);
        let largest = LARGEST_INNOVATION * usual;
        let step = innovation.clamp(-largest, largest) / (own + variance);
        for (mean, cross) in self.mean.iter_mut().zip(cross) {
            *mean += cross * step;
        }
        for (row, by) in self.covariance.iter_mut().zip(cross) {
            for (entry, cross) in row.iter_mut().zip(cross) {
                *entry -= by * cross / (own + variance);
            }
        }
    }

    /// Forgets c, as after a push: the tip is elsewhere, and its plays are not.
    pub fn forget_constants(&mut self) {
        for (index, row) in self.covariance.iter_mut().enumerate() {
            if (6..9).contains(&index)
                && let Some(entry) = row.get_mut(index)
            {
                *entry += square(CONSTANT);
            }
        }
    }

    /// The gain of each DOF (3,).
    pub fn gain(&self) -> PerDof<f64> {
        let [g1, g2, g3, ..] = self.mean;
        [g1, g2, g3].map(|over| (1.0 + over).clamp(LEAST_GAIN, LARGEST_GAIN))
    }

    /// The error of the geometry, and its covariance.
    pub fn geometry(&self) -> ([f64; GEOMETRY], [[f64; GEOMETRY]; GEOMETRY]) {
        let last = |[.., a, b, c]: Coefficients| [a, b, c];
        let [unevenness, u, v] = last(self.mean);
        let [.., first, second, third] = self.covariance;
        (
            [
                unevenness.clamp(-LARGEST_UNEVENNESS, LARGEST_UNEVENNESS),
                u,
                v,
            ],
            [first, second, third].map(last),
        )
    }
}

fn scaled([a, b, c]: PerDof<f64>, [x, y, z]: PerDof<f64>) -> PerDof<f64> {
    [a * x, b * y, c * z]
}

fn product(a: &Coefficients, b: &Coefficients) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
