//! Settings of instrument and camera. Names and units are those of the TOML keys.

/// Geometry of the instrument in m.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct InstrumentSettings {
    /// Length of the bending section.
    pub bending_length: f64,
    /// Distance of band A's centre from the end of the bending section.
    pub marker_a: f64,
    /// Distance of band B's centre from the end of the bending section.
    pub marker_b: f64,
    /// Diameter of the shaft and its bands.
    pub diameter: f64,
    /// Length of a band along the shaft.
    pub band_length: f64,
}

/// Camera and its pose.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct CameraSettings {
    /// Focal length along u in px.
    pub fx: f64,
    /// Focal length along v in px.
    pub fy: f64,
    /// Principal point, u in px.
    pub cx: f64,
    /// Principal point, v in px.
    pub cy: f64,
    /// Rational distortion k1, k2, p1, p2, k3, k4, k5, k6, in the order of `OpenCV`.
    pub distortion: [f64; 8],
    /// Pose of the guide in the camera frame.
    pub camera_from_guide: PoseSettings,
}

/// A rigid transform.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize))]
pub struct PoseSettings {
    /// Translation in m.
    pub translation: [f64; 3],
    /// Rotation vector in rad.
    pub rotation: [f64; 3],
}
