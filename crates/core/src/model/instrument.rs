//! Kinematics of the instrument, Eq. (7), Fig. 4.

use crate::dof::PerDof;
use crate::error::{ConfigError, require_non_negative, require_positive};
use crate::math::linear::{Vector, sinc, sinc_slope};

/// Geometry of the instrument in m, Fig. 4.
///
/// Guide frame: origin where the instrument leaves the guide, z along the channel outwards.
/// Insertion q1 is the length of straight shaft outside the guide; then comes a section of
/// constant curvature that bends by the total angle q3 towards (cos q2, sin q2, 0); then a
/// straight tip with two marker bands.
///
/// Wrong when the section sags or touches tissue: its curvature is then not constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    bending_length: f64,
    markers: [f64; 2],
    /// Radius of the tip in m.
    pub(crate) radius: f64,
    /// Length of a band along the axis in m.
    pub(crate) band_length: f64,
    unevenness: f64,
}

/// The centre of a marker band on the instrument's axis, its axis, and their derivatives by the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marker {
    /// The centre, (3,) in m.
    pub position: Vector,
    /// Unit vector along the tip, outwards.
    pub axis: Vector,
    /// `d position / d q`, one vector per DOF [1, m/rad, m/rad].
    pub position_by_dof: PerDof<Vector>,
    /// `d axis / d q`, one vector per DOF [1/m, 1/rad, 1/rad].
    pub axis_by_dof: PerDof<Vector>,
}

impl Instrument {
    /// An instrument from the length of its bending section, the distances of the bands' centres A
    /// and B from that section's distal end, the radius of the tip and the bands' length in m.
    ///
    /// With radius and band length 0 a band is a point on the axis.
    ///
    /// # Errors
    /// A value is not finite, `bending_length` is not above 0, or another is below 0.
    pub fn new(
        bending_length: f64,
        marker_a: f64,
        marker_b: f64,
        radius: f64,
        band_length: f64,
    ) -> Result<Self, ConfigError> {
        require_positive("bending_length", bending_length)?;
        require_non_negative("marker_a", marker_a)?;
        require_non_negative("marker_b", marker_b)?;
        require_non_negative("radius", radius)?;
        require_non_negative("band_length", band_length)?;
        Ok(Self {
            bending_length,
            markers: [marker_a, marker_b],
            radius,
            band_length,
            unevenness: 0.0,
        })
    }

    /// The instrument whose curvature at the share x of its section, counted from the guide, is 1 + `unevenness` (2 x - 1)
    /// times the mean, to first order: the tip is displaced across the chord of the section, towards the side it bends to, by
    ///
    /// ```text
    /// unevenness bending_length sinc'(q3 / 2),    sinc(x) = sin(x) / x
    /// ```
    #[must_use]
    pub const fn with_unevenness(self, unevenness: f64) -> Self {
        Self { unevenness, ..self }
    }

    /// The instrument whose bands A and B are farther from the section by (2,) in m.
    #[must_use]
    pub(crate) const fn with_bands_moved(self, [by_a, by_b]: [f64; 2]) -> Self {
        let [a, b] = self.markers;
        Self {
            markers: [a + by_a, b + by_b],
            ..self
        }
    }

    /// Displacement of the tip per unevenness (radial, axial), and its derivative by q3 [m, m/rad].
    fn displacement(&self, bending: f64) -> ([f64; 2], [f64; 2]) {
        let half = bending / 2.0;
        let (sin, cos) = libm::sincos(half);
        let slope = sinc_slope(half);
        let curve = if half == 0.0 {
            -1.0 / 3.0
        } else {
            -sinc(half) - 2.0 * slope / half
        };
        let scale = self.bending_length;
        (
            [scale * slope * cos, -scale * slope * sin],
            [
                scale / 2.0 * (curve * cos - slope * sin),
                -scale / 2.0 * (curve * sin + slope * cos),
            ],
        )
    }

    /// Length of the displacement of the tip across the chord per unevenness, in m.
    pub(crate) fn across(&self, bending: f64) -> f64 {
        self.bending_length * sinc_slope(bending / 2.0)
    }

    /// Point and unit tangent of the section's axis in the guide frame at a distance (m) from its distal end; None if that is
    /// not on the section.
    pub(crate) fn section(
        &self,
        [insertion, rotation, bending]: PerDof<f64>,
        distance: f64,
    ) -> Option<(Vector, Vector)> {
        let share = 1.0 - distance / self.bending_length;
        let part = Self {
            bending_length: share * self.bending_length,
            markers: [0.0; 2],
            ..*self
        };
        let [end, _] = part.markers([insertion, rotation, share * bending]);
        (share > 0.0).then_some((end.position, end.axis))
    }

    /// f(q), Eq. (7): bands A and B in the guide frame for the state q (3,) [m, rad, rad].
    ///
    /// ```text
    /// f = (r cos q2, r sin q2, q1 + z)
    /// r = bending_length (1 - cos q3) / q3 + d sin q3
    /// z = bending_length sin q3 / q3 + d cos q3
    /// ```
    ///
    /// with the band's distance d from the section's end; exact and smooth at q3 = 0.
    pub fn markers(&self, [insertion, rotation, bending]: PerDof<f64>) -> [Marker; 2] {
        let (sin_rotation, cos_rotation) = libm::sincos(rotation);
        let (sin_bend, cos_bend) = libm::sincos(bending);
        let half = bending / 2.0;
        let (sin_half, cos_half) = libm::sincos(half);
        let (sinc_half, sinc_half_slope) = (sinc(half), sinc_slope(half));
        // (1 - cos x) / x without the cancellation of a difference.
        let across = sin_half * sinc_half;
        let across_slope = 0.5 * (cos_half * sinc_half + sin_half * sinc_half_slope);
        let in_plane =
            |radial: f64, axial: f64| [radial * cos_rotation, radial * sin_rotation, axial];
        let rotated = |radial: f64| [-radial * sin_rotation, radial * cos_rotation, 0.0];

        let ([across_1, along_1], [across_2, along_2]) = self.displacement(bending);
        let uneven = |value: f64, by: f64| {
            if self.unevenness == 0.0 {
                value
            } else {
                value + self.unevenness * by
            }
        };
        self.markers.map(|distance| {
            let length = self.bending_length;
            let radial = uneven(length * across + distance * sin_bend, across_1);
            let axial = uneven(
                insertion + length * sinc(bending) + distance * cos_bend,
                along_1,
            );
            let radial_slope = uneven(length * across_slope + distance * cos_bend, across_2);
            let axial_slope = uneven(length * sinc_slope(bending) - distance * sin_bend, along_2);
            Marker {
                position: in_plane(radial, axial),
                axis: in_plane(sin_bend, cos_bend),
                position_by_dof: [
                    [0.0, 0.0, 1.0],
                    rotated(radial),
                    in_plane(radial_slope, axial_slope),
                ],
                axis_by_dof: [[0.0; 3], rotated(sin_bend), in_plane(cos_bend, -sin_bend)],
            }
        })
    }
}
