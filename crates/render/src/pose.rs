use crate::Error;
use crate::error::finite;
use crate::vector::{Vector, add, cross, dot, norm, scale};

/// A rigid motion, `p_in_camera = R p_in_guide + t`.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    axis: Vector,
    angle: f64,
    translation: Vector,
}

impl Pose {
    /// From a translation (3) (m) and a rotation vector (3), axis times angle (rad).
    ///
    /// # Errors
    /// A component that is not finite.
    pub fn new(translation: [f64; 3], rotation: [f64; 3]) -> Result<Self, Error> {
        for value in translation {
            finite("camera.camera_from_guide.translation", value)?;
        }
        for value in rotation {
            finite("camera.camera_from_guide.rotation", value)?;
        }
        let angle = norm(rotation);
        let axis = if angle > 0.0 {
            scale(rotation, 1.0 / angle)
        } else {
            [0.0, 0.0, 1.0]
        };
        Ok(Self {
            axis,
            angle,
            translation,
        })
    }

    /// Rotates a direction by Rodrigues' formula:
    /// `R v = v cos a + (k x v) sin a + k (k . v)(1 - cos a)`.
    pub(crate) fn rotate(&self, v: Vector) -> Vector {
        let (sin, cos) = self.angle.sin_cos();
        add(
            add(scale(v, cos), scale(cross(self.axis, v), sin)),
            scale(self.axis, dot(self.axis, v) * (1.0 - cos)),
        )
    }

    /// Transforms a point.
    pub(crate) fn transform(&self, p: Vector) -> Vector {
        add(self.rotate(p), self.translation)
    }
}
