//! Model of the endoscope's camera, Eq. (8).

use crate::error::{ConfigError, require_finite, require_positive};
use crate::math::linear::{Matrix, Vector, add, rotate, sinc};

/// Pinhole camera with the distortion model of `OpenCV`, Eq. (8).
///
/// ```text
/// x = X / Z,  y = Y / Z,  r2 = x^2 + y^2
/// g = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
/// u = cx + fx (x g + 2 p1 x y + p2 (r2 + 2 x^2))
/// v = cy + fy (y g + p1 (r2 + 2 y^2) + 2 p2 x y)
/// ```
///
/// for a point (X, Y, Z) in m in the camera frame (x right, y down, z forward); u, v in px.
///
/// Wrong far outside the calibrated field, where the polynomial folds back into the image.
/// Source: `OpenCV`, `calib3d` module, "Camera Calibration and 3D Reconstruction".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    focal: [f64; 2],
    centre: [f64; 2],
    distortion: [f64; 8],
}

/// An image point and its Jacobian by the point in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// u, v in px.
    pub pixel: [f64; 2],
    /// `d pixel / d p_in_camera`, two rows in px/m.
    pub pixel_by_point: [Vector; 2],
    /// Whether the distortion mirrors the image here, which no lens does.
    pub is_folded: bool,
}

impl Camera {
    /// A camera from focal lengths and principal point in px and
    /// `distortion` k1, k2, p1, p2, k3, k4, k5, k6, `OpenCV`'s order.
    ///
    /// # Errors
    /// A value is not finite, or a focal length is not above 0.
    pub fn new(
        [fx, fy]: [f64; 2],
        [cx, cy]: [f64; 2],
        distortion: [f64; 8],
    ) -> Result<Self, ConfigError> {
        require_positive("fx", fx)?;
        require_positive("fy", fy)?;
        require_finite("cx", cx)?;
        require_finite("cy", cy)?;
        for value in distortion {
            require_finite("distortion", value)?;
        }
        Ok(Self {
            focal: [fx, fy],
            centre: [cx, cy],
            distortion,
        })
    }

    /// The camera whose image is shifted by (u, v) px.
    pub(crate) const fn with_shift(self, [u, v]: [f64; 2]) -> Self {
        let [cx, cy] = self.centre;
        Self {
            centre: [cx + u, cy + v],
            ..self
        }
    }

    /// g(p), Eq. (8): the image of a point in the camera frame, and its Jacobian.
    ///
    /// None at or behind the camera, and where the result is not finite.
    pub fn project(&self, [across, down, depth]: Vector) -> Option<Projection> {
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        let (x, y) = (across / depth, down / depth);
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.distortion;
        let square = x * x + y * y;
        let above = 1.0 + square * (k1 + square * (k2 + square * k3));
        let below = 1.0 + square * (k4 + square * (k5 + square * k6));
        let above_slope = k1 + square * (2.0 * k2 + square * 3.0 * k3);
        let below_slope = k4 + square * (2.0 * k5 + square * 3.0 * k6);
        let gain = above / below;
        // d gain / dx is this times x, d gain / dy this times y.
        let gain_slope = 2.0 * (above_slope - gain * below_slope) / below;

        let bent_x = x * gain + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x);
        let bent_y = y * gain + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y;
        let x_by_x = gain + x * x * gain_slope + 2.0 * p1 * y + 6.0 * p2 * x;
        let x_by_y = x * y * gain_slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let y_by_x = x_by_y;
        let y_by_y = gain + y * y * gain_slope + 6.0 * p1 * y + 2.0 * p2 * x;

        let determinant = x_by_x * y_by_y - x_by_y * y_by_x;

        let [fx, fy] = self.focal;
        let [cx, cy] = self.centre;
        let row = |focal: f64, by_x: f64, by_y: f64| {
            let unit = focal / depth;
            [unit * by_x, unit * by_y, -unit * (by_x * x + by_y * y)]
        };
        let pixel = [cx + fx * bent_x, cy + fy * bent_y];
        pixel
            .iter()
            .all(|value| value.is_finite())
            .then(|| Projection {
                pixel,
                pixel_by_point: [row(fx, x_by_x, x_by_y), row(fy, y_by_x, y_by_y)],
                is_folded: determinant <= 0.0 || x_by_x + y_by_y <= 0.0,
            })
    }
}

/// A rigid transform, named by its frames: `camera_from_guide` transforms from the guide to the camera frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    rotation: Matrix,
    translation: Vector,
}

impl Pose {
    /// A pose from a translation in m and a rotation vector, axis times angle in rad (Rodrigues).
    ///
    /// # Errors
    /// A value is not finite.
    pub fn new(translation: Vector, rotation_vector: Vector) -> Result<Self, ConfigError> {
        for value in translation {
            require_finite("translation", value)?;
        }
        for value in rotation_vector {
            require_finite("rotation", value)?;
        }
        Ok(Self {
            rotation: rotation_matrix(rotation_vector),
            translation,
        })
    }

    /// Turned about the origin of the outer frame by a rotation vector (rad), then displaced by a vector (m).
    pub(crate) fn moved(&self, shift: Vector, turn: Vector) -> Self {
        let matrix = rotation_matrix(turn);
        let [x, y, z] = transposed(&self.rotation).map(|column| rotate(&matrix, column));
        Self {
            rotation: transposed(&[x, y, z]),
            translation: add(rotate(&matrix, self.translation), 1.0, shift),
        }
    }

    /// Transforms a point from the inner frame to the outer.
    pub(crate) fn transform(&self, point: Vector) -> Vector {
        add(self.rotate(point), 1.0, self.translation)
    }

    /// Rotates a direction from the inner frame to the outer.
    pub(crate) fn rotate(&self, direction: Vector) -> Vector {
        rotate(&self.rotation, direction)
    }
}

/// The rotation by a vector, axis times angle in rad (Rodrigues).
fn rotation_matrix([x, y, z]: Vector) -> Matrix {
    let angle = libm::sqrt(x * x + y * y + z * z);
    let turn = sinc(angle);
    let half = sinc(angle / 2.0);
    let versine = half * half / 2.0;
    let diagonal = |a: f64, b: f64| 1.0 - versine * (a * a + b * b);
    [
        [
            diagonal(y, z),
            versine * x * y - turn * z,
            versine * x * z + turn * y,
        ],
        [
            versine * x * y + turn * z,
            diagonal(x, z),
            versine * y * z - turn * x,
        ],
        [
            versine * x * z - turn * y,
            versine * y * z + turn * x,
            diagonal(x, y),
        ],
    ]
}

fn transposed(&[[a, b, c], [d, e, f], [g, h, i]]: &Matrix) -> Matrix {
    [[a, d, g], [b, e, h], [c, f, i]]
}
