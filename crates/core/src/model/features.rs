//! Predicted features and interaction matrix, Eqs. (9)-(11).

use core::f64::consts::PI;

use crate::dof::{PerDof, all_finite};
use crate::error::ConfigError;
use crate::math::linear::{Vector, add, dot, scale};
use crate::model::camera::{Camera, Pose, Projection};
use crate::model::instrument::{Instrument, Marker};
use crate::model::settings::{CameraSettings, InstrumentSettings};

/// Number of values in which the geometry may differ from the configured one.
pub const GEOMETRY: usize = 3;

/// h = g after f, Eqs. (9)-(11): from the state to the centroids of the two marker bands.
///
/// Decision 0002: the camera sees the near half of a cylindrical band, so the centroid of its
/// colour is not the image of its centre. The point that is projected, from the centre p, the
/// axis t, the radius r, the band's length l and the distance D of the camera from the axis, all
/// in m in the camera frame, is
///
/// ```text
/// m = p + r (pi/4 + (pi^2/8 - 1) r/D) n       n: unit vector from the axis to the camera, across
/// e = m - (4 / m_z) S z                       z: the optical axis
/// S = l^2 / 12 t t' + r^2 (2/3 - pi^2 / 16) n n' + r^2 / 3 (t x n) (t x n)'
/// ```
///
/// m is the mean of the visible surface, each element weighted by the solid angle it fills, to
/// first order in r/D; e accounts for near parts filling more of the image than far ones. With r = l = 0
/// it is the article's h.
///
/// Wrong where the endoscope or tissue hides part of a band, within a few radii of the camera, and, by
/// about 0.3 px, where the distortion varies strongly across a band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeatureModel {
    pub(crate) instrument: Instrument,
    camera: Camera,
    camera_from_guide: Pose,
}

/// Predicted features and their interaction matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeaturePrediction {
    /// h(q): u and v of band A, u and v of band B in px.
    pub features: [f64; 4],
    /// dh/dq, Eq. (11): one column of four per DOF [px/m, px/rad, px/rad].
    pub columns: PerDof<[f64; 4]>,
}

/// A vector that depends on the state, and its derivative by each DOF.
struct Differentiated {
    value: Vector,
    by_dof: PerDof<Vector>,
}

impl FeatureModel {
    /// The model of an instrument in the image of a camera.
    pub const fn new(instrument: Instrument, camera: Camera, camera_from_guide: Pose) -> Self {
        Self {
            instrument,
            camera,
            camera_from_guide,
        }
    }

    /// The model of a configured instrument and camera.
    ///
    /// # Errors
    /// As [`Instrument::new`], [`Camera::new`] and [`Pose::new`].
    pub(crate) fn from_settings(
        instrument: &InstrumentSettings,
        camera: &CameraSettings,
    ) -> Result<Self, ConfigError> {
        let pose = &camera.camera_from_guide;
        Ok(Self::new(
            Instrument::new(
                instrument.bending_length,
                instrument.marker_a,
                instrument.marker_b,
                instrument.diameter / 2.0,
                instrument.band_length,
            )?,
            Camera::new(
                [camera.fx, camera.fy],
                [camera.cx, camera.cy],
                camera.distortion,
            )?,
            Pose::new(pose.translation, pose.rotation)?,
        ))
    }

    /// h(q) and its interaction matrix for the state q (3,) [m, rad, rad].
    ///
    /// None where a band is not visible: behind the camera, seen along its axis, or in the part
    /// of the image that the distortion folds; and for a state that is not finite.
    pub fn predict(&self, state: PerDof<f64>) -> Option<FeaturePrediction> {
        let [marker_a, marker_b] = self.instrument.markers(state);
        let ([ua, va], [ua_by, va_by]) = self.centroid(&marker_a)?;
        let ([ub, vb], [ub_by, vb_by]) = self.centroid(&marker_b)?;
        let [[a0, a1, a2], [b0, b1, b2], [c0, c1, c2], [d0, d1, d2]] = [ua_by, va_by, ub_by, vb_by];
        let prediction = FeaturePrediction {
            features: [ua, va, ub, vb],
            columns: [[a0, b0, c0, d0], [a1, b1, c1, d1], [a2, b2, c2, d2]],
        };
        let finite = prediction.columns.iter().all(|column| all_finite(*column));
        finite.then_some(prediction)
    }

    /// The model of an instrument whose section bends unevenly, [`Instrument::with_unevenness`], in an image that is
    /// shifted by (u, v) px.
    #[must_use]
    pub const fn with_geometry(&self, [unevenness, u, v]: [f64; GEOMETRY]) -> Self {
        Self {
            instrument: self.instrument.with_unevenness(unevenness),
            camera: self.camera.with_shift([u, v]),
            ..*self
        }
    }

    /// The model of a camera that is displaced against the guide by `shift` (m) and turned about its own origin by the rotation
    /// vector `turn` (rad), and of bands that are `bands` (m) farther from the section.
    pub(crate) fn moved(&self, shift: Vector, turn: Vector, bands: [f64; 2]) -> Self {
        Self {
            instrument: self.instrument.with_bands_moved(bands),
            camera_from_guide: self.camera_from_guide.moved(shift, turn),
            ..*self
        }
    }

    /// Derivatives (4,) in px of the features by each geometry of [`FeatureModel::with_geometry`].
    ///
    /// None where [`FeatureModel::predict`] is.
    pub(crate) fn by_geometry(&self, state: PerDof<f64>) -> Option<[[f64; 4]; GEOMETRY]> {
        let [_, rotation, bending] = state;
        let (along, across) = (libm::sin(bending / 2.0), libm::cos(bending / 2.0));
        let direction = [
            across * libm::cos(rotation),
            across * libm::sin(rotation),
            -along,
        ];
        let [marker_a, marker_b] = self.instrument.markers(state).map(|marker| Marker {
            position_by_dof: [direction, [0.0; 3], [0.0; 3]],
            axis_by_dof: [[0.0; 3]; 3],
            ..marker
        });
        let (_, [[ua, _, _], [va, _, _]]) = self.centroid(&marker_a)?;
        let (_, [[ub, _, _], [vb, _, _]]) = self.centroid(&marker_b)?;
        let length = self.instrument.across(bending);
        let unevenness = [ua, va, ub, vb].map(|by| length * by);
        Some([unevenness, [1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]])
    }

    /// Centre and axis of each band in the camera frame.
    pub(crate) fn axes(&self, state: PerDof<f64>) -> [(Vector, Vector); 2] {
        let markers = self.instrument.markers(state);
        markers.map(|marker| self.seen(marker.position, marker.axis))
    }

    /// A point and a direction in the guide frame, in the camera frame.
    pub(crate) fn seen(&self, point: Vector, direction: Vector) -> (Vector, Vector) {
        let pose = &self.camera_from_guide;
        (pose.transform(point), pose.rotate(direction))
    }

    /// The image of a point in the camera frame; None where it has none.
    pub(crate) fn project(&self, point: Vector) -> Option<Projection> {
        let projection = self.camera.project(point)?;
        (!projection.is_folded).then_some(projection)
    }

    /// The centroid (u, v) in px of the image of a band, and the derivatives of u and v by each DOF.
    fn centroid(&self, marker: &Marker) -> Option<([f64; 2], [PerDof<f64>; 2])> {
        let (centre, axis) = self.seen(marker.position, marker.axis);
        let rotated = |by: PerDof<Vector>| by.map(|by| self.camera_from_guide.rotate(by));
        let centre = Differentiated {
            value: centre,
            by_dof: rotated(marker.position_by_dof),
        };
        let axis = Differentiated {
            value: axis,
            by_dof: rotated(marker.axis_by_dof),
        };
        let point = self.visible_point(&centre, &axis)?;
        let projection = self.project(point.value)?;
        let by_dof = projection
            .pixel_by_point
            .map(|row| point.by_dof.map(|by| dot(row, by)));
        Some((projection.pixel, by_dof))
    }

    /// The point whose image is the centroid of the visible part of a band.
    fn visible_point(
        &self,
        centre: &Differentiated,
        axis: &Differentiated,
    ) -> Option<Differentiated> {
        let (radius, length) = (self.instrument.radius, self.instrument.band_length);
        let (p, t) = (centre.value, axis.value);
        let along = dot(p, t);
        let across = add(scale(-1.0, p), along, t);
        let distance = libm::sqrt(dot(across, across));
        // From inside the infinitely extended cylinder its outside is not visible.
        if distance.is_nan() || distance <= radius {
            return None;
        }
        let n = scale(1.0 / distance, across);
        let nearer = (PI * PI / 8.0 - 1.0) * radius * radius / distance;
        let lift = PI / 4.0 * radius + nearer;
        let mean = add(p, lift, n);

        let spread_across = radius * radius / 3.0;
        let spread_along = length * length / 12.0 - spread_across;
        let spread_towards = radius * radius * (2.0 / 3.0 - PI * PI / 16.0) - spread_across;
        let [[_, _, n_z], [_, _, t_z], [_, _, mean_z]] = [n, t, mean];
        // S z; the part across t and n is the remainder of z.
        let spread = add(
            add([0.0, 0.0, spread_across], spread_along * t_z, t),
            spread_towards * n_z,
            n,
        );
        let pull = -4.0 / mean_z;

        let derivative = |p_by: Vector, t_by: Vector| {
            let along_by = dot(p_by, t) + dot(p, t_by);
            let across_by = add(add(scale(-1.0, p_by), along_by, t), along, t_by);
            let distance_by = dot(across_by, n);
            let n_by = scale(1.0 / distance, add(across_by, -distance_by, n));
            let lift_by = -nearer * distance_by / distance;
            let mean_by = add(add(p_by, lift, n_by), lift_by, n);
            let [[_, _, n_z_by], [_, _, t_z_by], [_, _, mean_z_by]] = [n_by, t_by, mean_by];
            let along_part = add(scale(t_z_by, t), t_z, t_by);
            let towards_part = add(scale(n_z_by, n), n_z, n_by);
            let spread_by = add(
                scale(spread_along, along_part),
                spread_towards,
                towards_part,
            );
            let stretched = add(spread_by, -mean_z_by / mean_z, spread);
            add(mean_by, pull, stretched)
        };
        let [p0, p1, p2] = centre.by_dof;
        let [t0, t1, t2] = axis.by_dof;
        Some(Differentiated {
            value: add(mean, pull, spread),
            by_dof: [derivative(p0, t0), derivative(p1, t1), derivative(p2, t2)],
        })
    }
}
