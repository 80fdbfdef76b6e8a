//! The outline of a band in the image, with its area, centroid and moments.

use crate::dof::{PerDof, all_finite};
use crate::math::linear::{Vector, add, cross, dot, scale};
use crate::model::features::FeatureModel;

/// Points on the visible half of each of a band's two rims.
const RIM: usize = 13;

/// Points of an outline.
pub const OUTLINE: usize = 2 * RIM;

/// The image of a band: the side of a cylinder that faces the camera.
///
/// With the band's centre p, its axis t, radius r and length l; D the distance from the camera to
/// the axis, n the unit vector from the axis to the camera across the axis and b = t x n:
///
/// ```text
/// outline:  g(p +- l/2 t + r (n cos phi + b sin phi)),   |phi| <= acos(r / D)
/// area = sum of x_i y_j - x_j y_i over its edges / 2;    moments likewise (Green's theorem)
/// ```
///
/// The rims' visible arcs and the two lines along which rays from the camera touch the cylinder enclose its visible part
/// exactly; 12 chords replace each arc, which reduces its height by 1 %.
///
/// Wrong where anything, including the instrument itself, is in front of the band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandImage {
    /// Corners u, v (px) in order.
    pub outline: [[f64; 2]; OUTLINE],
    /// Area (px^2).
    pub area: f64,
    /// Centroid u, v (px): equal to that of `FeatureModel::predict` up to the lens distortion.
    pub centroid: [f64; 2],
    /// Second central moments over area: uu, uv, vv (px^2).
    pub moments: [f64; 3],
}

impl FeatureModel {
    /// The images of bands A and B for the state q (3,) [m, rad, rad].
    ///
    /// None where `predict` is, and where a part of an outline cannot be projected.
    pub fn bands(&self, state: PerDof<f64>) -> Option<[BandImage; 2]> {
        let [a, b] = self.axes(state);
        Some([self.band(a)?, self.band(b)?])
    }

    fn band(&self, (centre, axis): (Vector, Vector)) -> Option<BandImage> {
        let (radius, length) = (self.instrument.radius, self.instrument.band_length);
        let across = add(scale(-1.0, centre), dot(centre, axis), axis);
        let distance = libm::sqrt(dot(across, across));
        if distance.is_nan() || distance <= radius {
            return None;
        }
        let towards = scale(1.0 / distance, across);
        let beside = cross(axis, towards);
        let horizon = libm::acos(radius / distance);
        let mut outline = [[0.0; 2]; OUTLINE];
        #[expect(clippy::cast_precision_loss, reason = "a few points")]
        for (index, corner) in outline.iter_mut().enumerate() {
            let (end, place) = if index < RIM {
                (-0.5, index)
            } else {
                (0.5, OUTLINE - 1 - index)
            };
            let share = 2.0 * place as f64 / (RIM - 1) as f64 - 1.0;
            let (sin, cos) = libm::sincos(horizon * share);
            let rim = add(centre, end * length, axis);
            let point = add(add(rim, radius * cos, towards), radius * sin, beside);
            *corner = self.project(point)?.pixel;
        }
        moments(&outline)
    }
}

/// Area, centroid and second moments of the region in an outline; None if its area is 0 or not finite.
fn moments(outline: &[[f64; 2]; OUTLINE]) -> Option<BandImage> {
    let [first, ..] = *outline;
    let (mut area, mut sum, mut square) = (0.0, [0.0; 2], [0.0; 3]);
    let next = outline.iter().skip(1).chain([&first]);
    // Relative to the first corner: far from the origin the sums would cancel.
    for (from, to) in outline.iter().zip(next) {
        let [x0, y0] = [from[0] - first[0], from[1] - first[1]];
        let [x1, y1] = [to[0] - first[0], to[1] - first[1]];
        let cross = x0 * y1 - x1 * y0;
        area += cross / 2.0;
        sum[0] += (x0 + x1) * cross / 6.0;
        sum[1] += (y0 + y1) * cross / 6.0;
        square[0] += (x0 * x0 + x0 * x1 + x1 * x1) * cross / 12.0;
        square[1] += (x0 * (2.0 * y0 + y1) + x1 * (y0 + 2.0 * y1)) * cross / 24.0;
        square[2] += (y0 * y0 + y0 * y1 + y1 * y1) * cross / 12.0;
    }
    let [x, y] = sum.map(|sum| sum / area);
    let [xx, xy, yy] = square.map(|square| square / area);
    let image = BandImage {
        outline: *outline,
        area: area.abs(),
        centroid: [first[0] + x, first[1] + y],
        moments: [xx - x * x, xy - x * y, yy - y * y],
    };
    (all_finite([image.area, x, y]) && image.area > 0.0).then_some(image)
}
