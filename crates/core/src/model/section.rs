//! The image of the bending section next to the tip.

use crate::dof::PerDof;
use crate::math::linear::{Vector, add, cross, dot, scale};
use crate::model::features::FeatureModel;

/// Discs along the section.
pub const SECTION_DISCS: usize = 8;

/// The image of a short piece of the section, approximately.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionDisc {
    /// Centre u, v (px).
    pub centre: [f64; 2],
    /// Radius (px).
    pub radius: f64,
    /// Whether its surface is nearer to the camera than the centre of band A and of band B.
    pub is_nearer: [bool; 2],
}

impl FeatureModel {
    /// Discs that cover the image of the section from its distal end inwards, a radius of the instrument apart, for the
    /// state q (3,) [m, rad, rad]; None for a disc that has no image or that would be on the shaft.
    ///
    /// The centre is the image of the axis at the arc length s, and the radius that of a sphere of the instrument's radius:
    ///
    /// ```text
    /// p(s) = f(q1, q2, q3 s / L) with d = 0 and the section's length s;    s = L - k r,  k = 0 ... 7
    /// ```
    ///
    /// Wrong where the section's curvature is not constant.
    pub fn section(&self, state: PerDof<f64>) -> [Option<SectionDisc>; SECTION_DISCS] {
        let radius = self.instrument.radius;
        let bands = self.axes(state).map(|(centre, _)| norm(centre));
        core::array::from_fn(|index| {
            #[expect(clippy::cast_precision_loss, reason = "a few discs")]
            let (point, direction) = self.instrument.section(state, index as f64 * radius)?;
            let (centre, axis) = self.seen(point, direction);
            let distance = norm(centre);
            let beside = cross(centre, axis);
            let across = scale(radius / norm(beside), beside);
            let [u, v] = self.project(centre)?.pixel;
            let [u1, v1] = self.project(add(centre, 1.0, across))?.pixel;
            Some(SectionDisc {
                centre: [u, v],
                radius: libm::hypot(u1 - u, v1 - v),
                is_nearer: bands.map(|band| distance + radius < band),
            })
        })
    }
}

fn norm(vector: Vector) -> f64 {
    libm::sqrt(dot(vector, vector))
}
