//! What the instrument is made of, and how it appears in the light of the endoscope.

use crate::vector::Vector;

/// Light guides beside the lens, in the camera's frame (m).
const LIGHTS: [[f32; 3]; 2] = [[-3.0e-3, -1.0e-3, 0.0], [3.0e-3, -1.0e-3, 0.0]];
/// Share of the light that comes back from the tissue all around.
const AMBIENT: f32 = 0.42;
/// Distance at which the light has fallen to half (m); the exposure control compensates for the rest.
const FALLOFF: f32 = 90e-3;
const EXPOSURE: f32 = 1.15;

/// A surface, lit by Lambert's law and Blinn and Phong's highlight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Material {
    /// Which of the bands this is, if any.
    pub(crate) band: Option<usize>,
    /// Diffuse colour: blue, green, red (grey levels).
    colour: [f32; 3],
    /// Height of the highlight (grey levels).
    gloss: f32,
    /// log2 of the highlight's exponent.
    sharpness: i32,
    /// Ribs around the tube: how far the normal tilts (rad), how much darker the grooves are.
    pub(crate) tilt: f32,
    groove: f32,
    /// Distance between two ribs (m).
    pub(crate) pitch: f64,
}

pub(crate) const SHAFT: Material = Material {
    band: None,
    colour: [74.0, 70.0, 68.0],
    gloss: 170.0,
    sharpness: 5,
    tilt: 0.0,
    groove: 0.0,
    pitch: 1.0,
};
pub(crate) const SECTION: Material = Material {
    band: None,
    colour: [40.0, 38.0, 38.0],
    gloss: 95.0,
    sharpness: 4,
    tilt: 0.55,
    groove: 0.45,
    pitch: 1.25e-3,
};
pub(crate) const TIP: Material = Material {
    colour: [172.0, 174.0, 172.0],
    gloss: 120.0,
    ..SHAFT
};
pub(crate) const BAND_A: Material = Material {
    band: Some(0),
    colour: [70.0, 190.0, 60.0],
    gloss: 70.0,
    sharpness: 6,
    ..SHAFT
};
pub(crate) const BAND_B: Material = Material {
    band: Some(1),
    ..BAND_A
};

impl Material {
    /// Phase of the ribs at arc length `s` from the start of the material: (tilt of the normal
    /// towards the distal end (rad), factor on the diffuse colour).
    pub(crate) fn rib(&self, s: f64) -> (f32, f32) {
        if self.tilt <= 0.0 {
            return (0.0, 1.0);
        }
        let (sin, cos) = (core::f64::consts::TAU * s / self.pitch).sin_cos();
        (
            self.tilt * sin as f32,
            1.0 - self.groove * 0.5 * (1.0 + cos as f32),
        )
    }

    /// Blue, green and red of the point `p` (m) with unit normal `n`, both in the camera's frame;
    /// `shade` is a factor on the diffuse colour. From 2 to 253, so that rounding in interpolation
    /// cannot leave 0 to 255.
    pub(crate) fn shaded(&self, p: [f32; 3], n: [f32; 3], shade: f32) -> [f32; 3] {
        let distance2 = dot(p, p);
        let view = scale(p, -1.0 / distance2.sqrt());
        let mut lambert = 0.0;
        let mut highlight = 0.0;
        for light in LIGHTS {
            let to_light = unit([light[0] - p[0], light[1] - p[1], light[2] - p[2]]);
            lambert += dot(n, to_light).max(0.0);
            let half = unit([
                to_light[0] + view[0],
                to_light[1] + view[1],
                to_light[2] + view[2],
            ]);
            let mut peak = dot(n, half).max(0.0);
            for _ in 0..self.sharpness {
                peak *= peak;
            }
            highlight += peak;
        }
        let share = 1.0 / LIGHTS.len() as f32;
        let gain = EXPOSURE / (1.0 + distance2 / (FALLOFF * FALLOFF));
        let diffuse = gain * shade * (AMBIENT + (1.0 - AMBIENT) * lambert * share);
        let gloss = gain * self.gloss * highlight * share;
        self.colour.map(|c| (c * diffuse + gloss).clamp(2.0, 253.0))
    }
}

pub(crate) fn single(v: Vector) -> [f32; 3] {
    v.map(|x| x as f32)
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn scale(a: [f32; 3], k: f32) -> [f32; 3] {
    a.map(|x| x * k)
}

fn unit(a: [f32; 3]) -> [f32; 3] {
    scale(a, 1.0 / dot(a, a).max(1e-20).sqrt())
}
