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
        let (radius, _) = self.size();
        let bands = self.axes(state).map(|(centre, _)| norm(centre));
        core::array::from_fn(|index| {
            #[expect(clippy::cast_precision_loss, reason = "a few discs")]
            let (centre, axis) = self.section_axis(state, index as f64 * radius)?;
            let distance = norm(centre);
            let beside = cross(centre, axis);
            let across = scale(radius / norm(beside), beside);
            let [u, v] = self.project(centre)?;
            let [u1, v1] = self.project(add(centre, 1.0, across))?;
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

#[cfg(test)]
mod tests {
    use crate::math::linear::{add, dot};
    use crate::model::instrument::Instrument;

    #[test]
    fn tangent_is_the_derivative_of_the_axis_and_the_end_is_where_the_tip_begins() {
        let at_end = Instrument::new(30e-3, 0.0, 0.0, 1.75e-3, 4e-3).unwrap();
        for state in [[20e-3, 0.4, 1.6], [35e-3, -1.9, 0.0], [10e-3, 2.0, -0.2]] {
            let [end, _] = at_end.markers(state);
            assert_eq!(at_end.section(state, 0.0), Some((end.position, end.axis)));
            for distance in [2e-3, 9e-3, 25e-3] {
                let step = 1e-6;
                let [near, here, far] =
                    [-step, 0.0, step].map(|by| at_end.section(state, distance + by).unwrap());
                let slope = add(near.0, -1.0, far.0).map(|value| value / (2.0 * step));
                let error = add(slope, -1.0, here.1);
                assert!(dot(error, error).sqrt() < 1e-6, "{state:?} {distance}");
            }
            assert_eq!(at_end.section(state, 31e-3), None);
        }
    }
}
