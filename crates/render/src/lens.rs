use crate::Error;
use crate::error::{finite, positive};

/// Nothing nearer than this to the camera is drawn (m).
const NEAR: f32 = 2e-3;
/// Largest tangent of the angle off the optical axis: 80 degrees.
const WIDEST: f32 = 5.7;

/// Pinhole camera with the eight distortion coefficients of `OpenCV`:
///
/// ```text
/// x = X / Z, y = Y / Z, r² = x² + y²
/// c = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
/// u = fx (x c + 2 p1 x y + p2 (r² + 2 x²)) + cx
/// v = fy (y c + p1 (r² + 2 y²) + 2 p2 x y) + cy
/// ```
///
/// It is written for the twin alone: the loop under test has its own, so that an error in one is found.
///
/// Source: `OpenCV`, "Camera Calibration and 3D Reconstruction".
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    focal: [f32; 2],
    centre: [f32; 2],
    k: [f32; 8],
    /// r² up to which the image radius grows with the angle; beyond it the polynomial folds back.
    reach: f32,
}

impl Lens {
    /// From focal lengths and principal point (2) (px) and k1, k2, p1, p2, k3, k4, k5, k6.
    ///
    /// # Errors
    /// A value that is not finite, or a focal length that is not above zero.
    pub fn new(focal: [f64; 2], centre: [f64; 2], distortion: [f64; 8]) -> Result<Self, Error> {
        positive("camera.fx", focal[0])?;
        positive("camera.fy", focal[1])?;
        finite("camera.cx", centre[0])?;
        finite("camera.cy", centre[1])?;
        for value in distortion {
            finite("camera.distortion", value)?;
        }
        let mut lens = Self {
            focal: focal.map(|v| v as f32),
            centre: centre.map(|v| v as f32),
            k: distortion.map(|v| v as f32),
            reach: 0.0,
        };
        let steps = 2000;
        let mut radius = 0.0;
        for step in 1..=steps {
            let r = WIDEST * step as f32 / steps as f32;
            let bent = r * lens.radial(r * r);
            // Also stops at NaN and where the denominator changes sign.
            if bent.is_nan() || bent <= radius || bent > 1e3 {
                break;
            }
            radius = bent;
            lens.reach = r * r;
        }
        Ok(lens)
    }

    fn radial(&self, r2: f32) -> f32 {
        let [k1, k2, _, _, k3, k4, k5, k6] = self.k;
        (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    }

    /// Pixel of a point in the camera's frame (m); `None` when it is behind the camera, nearer
    /// than 2 mm, or so far off the axis that the distortion polynomial is no longer monotonic.
    pub(crate) fn project(&self, p: [f32; 3]) -> Option<[f32; 2]> {
        if p[2] <= NEAR {
            return None;
        }
        let inverse = 1.0 / p[2];
        let (x, y) = (p[0] * inverse, p[1] * inverse);
        let r2 = x * x + y * y;
        if r2.is_nan() || r2 > self.reach {
            return None;
        }
        let c = self.radial(r2);
        let [_, _, p1, p2, ..] = self.k;
        let xd = x * c + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let yd = y * c + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        Some([
            self.focal[0] * xd + self.centre[0],
            self.focal[1] * yd + self.centre[1],
        ])
    }
}
