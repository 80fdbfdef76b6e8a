use crate::Error;
use crate::curve::Curve;
use crate::error::{checked, finite, positive};
use crate::features::Patches;
use crate::lens::Lens;
use crate::material::{BAND_A, BAND_B, Material, SECTION, SHAFT, TIP, single};
use crate::raster::{Samples, Vertex};
use crate::vector::{Vector, add, cross, dot, norm, perpendicular, scale, sub, unit};

/// Facets across the visible side of the tube.
const FACETS: usize = 16;
/// Rings per rib of a ribbed material.
const RINGS_PER_RIB: f64 = 4.0;
/// Largest distance between two rings of a smooth material (m).
const RING_STEP: f64 = 1.0e-3;
/// Rings along one material at most, however long the instrument.
const RINGS: f64 = 400.0;
/// Rings of the rounded end.
const CAP_RINGS: u32 = 5;
/// Height of the rounded end over the tube's radius.
const CAP_HEIGHT: f64 = 0.4;

/// The instrument's geometry, in m: a tube with two bands, as `instrument` in the configuration.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
    /// Outer diameter.
    pub diameter: f64,
    /// Length of the bending section.
    pub bending_length: f64,
    /// Length of the rigid tip.
    pub tip_length: f64,
    /// Centres of the proximal and the distal band, from the distal end of the bending section.
    pub markers: [f64; 2],
    /// Length of each band.
    pub band_length: f64,
}

impl Geometry {
    pub(crate) fn check(&self) -> Result<(), Error> {
        positive("instrument.diameter", self.diameter)?;
        positive("instrument.bending_length", self.bending_length)?;
        positive("instrument.tip_length", self.tip_length)?;
        positive("instrument.band_length", self.band_length)?;
        finite("instrument.marker_a", self.markers[0])?;
        let last = self.tip_length - 0.5 * self.band_length;
        checked(
            "instrument.marker_b",
            self.markers[1],
            "a band distal of band A that ends before the tip does",
            |b| b >= self.markers[0] && b <= last + 1e-12,
        )?;
        Ok(())
    }

    /// Materials from the shaft to the end of the tip, each with the distance of its distal end from the end of
    /// the tip.
    fn materials(&self) -> [(Material, f64); 7] {
        let half = 0.5 * self.band_length;
        let [a, b] = self.markers.map(|marker| self.tip_length - marker);
        [
            (SHAFT, self.tip_length + self.bending_length),
            (SECTION, self.tip_length),
            (TIP, a + half),
            (BAND_A, a - half),
            (TIP, b + half),
            (BAND_B, b - half),
            (TIP, self.cap_height()),
        ]
    }

    /// Height of the rounded end, which does not reach band B.
    fn cap_height(&self) -> f64 {
        let free = self.tip_length - self.markers[1] - 0.5 * self.band_length;
        (CAP_HEIGHT * 0.5 * self.diameter).min(free.max(0.0))
    }
}

type Ring = [Vertex; FACETS + 1];

/// Sweeps the tube along its centreline and draws the side that faces the camera.
///
/// On a ring with centre C, axis T and radius ρ the outward normal is N(φ) = cos γ E(φ) + sin γ T
/// (γ is 0 on the tube and rises to 90 degrees over the rounded end). The point C + ρ E(φ) faces
/// the camera, at the origin, where N · (C + ρ E) < 0, so on the arc
///
/// ```text
/// cos(φ - φ0) > (ρ cos γ + (C · T) sin γ) / (d cos γ)
/// ```
///
/// with d the length of C's part across T and φ0 the angle of its negative. The facets divide that
/// arc: the outline is exact, and no hidden facet is created.
pub(crate) struct Sweep<'a> {
    pub(crate) curve: &'a Curve,
    pub(crate) lens: &'a Lens,
    pub(crate) samples: &'a mut Samples,
    pub(crate) bands: &'a mut Patches,
}

impl Sweep<'_> {
    /// Draws the whole instrument; the curve is in the camera's frame.
    pub(crate) fn draw(&mut self, geometry: &Geometry) {
        let length = self.curve.length();
        let radius = 0.5 * geometry.diameter;
        let mut start = 0.0;
        for (material, from_end) in geometry.materials() {
            let end = length - from_end;
            if end > start {
                self.tube(&material, radius, start, end);
                start = end;
            }
        }
        if length > 0.0 {
            self.cap(radius, (length - start).max(0.0));
        }
    }

    fn tube(&mut self, material: &Material, radius: f64, start: f64, end: f64) {
        let wanted = if material.tilt > 0.0 {
            material.pitch / RINGS_PER_RIB
        } else {
            RING_STEP
        };
        let count = ((end - start) / wanted).ceil().clamp(1.0, RINGS);
        let mut last = None;
        for i in 0..=count as u32 {
            let along = (end - start) * f64::from(i) / count;
            let (centre, axis) = self.curve.at(start + along);
            let (tilt, shade) = material.rib(along);
            let ring = self.ring(centre, axis, radius, 0.0, (material, tilt, shade));
            self.join(material, last.as_ref(), &ring);
            last = Some(ring);
        }
    }

    fn cap(&mut self, radius: f64, height: f64) {
        let (end, axis) = self.curve.at(f64::INFINITY);
        let rim = sub(end, scale(axis, height));
        let mut last = None;
        for i in 0..=CAP_RINGS {
            let slope = core::f64::consts::FRAC_PI_2 * f64::from(i) / f64::from(CAP_RINGS);
            let (sin, cos) = slope.sin_cos();
            let centre = add(rim, scale(axis, height * sin));
            // Rounded at its rim, flat in the middle.
            let here = radius * cos.sqrt();
            let ring = self.ring(centre, axis, here, slope, (&TIP, 0.0, 1.0));
            self.join(&TIP, last.as_ref(), &ring);
            last = Some(ring);
        }
    }

    /// The visible arc of one ring. `slope` is γ (rad).
    fn ring(
        &self,
        centre: Vector,
        axis: Vector,
        radius: f64,
        slope: f64,
        (material, tilt, shade): (&Material, f32, f32),
    ) -> Ring {
        let along = dot(centre, axis);
        let across = sub(scale(axis, along), centre);
        let d = norm(across);
        let e0 = unit(across).unwrap_or_else(|| perpendicular(axis));
        let e1 = cross(axis, e0);
        let (sin, cos) = slope.sin_cos();
        let bound = (radius * cos + along * sin) / (d * cos).max(1e-12);
        let half = bound.clamp(-1.0, 1.0).acos() as f32;
        // The corners are moved outwards such that facets and circle enclose the same area.
        let facet = (2.0 * half / FACETS as f32).max(1e-4);
        let radius = radius as f32 * (facet / facet.sin()).sqrt();
        let (centre, axis) = (single(centre), single(axis));
        let (e0, e1) = (single(e0), single(e1));
        let (lift, out) = (slope as f32 + tilt).sin_cos();
        core::array::from_fn(|j| {
            let phi = half * (2.0 * j as f32 / FACETS as f32 - 1.0);
            let (sin, cos) = phi.sin_cos();
            let e = [0, 1, 2].map(|k| cos * e0[k] + sin * e1[k]);
            let p = [0, 1, 2].map(|k| centre[k] + radius * e[k]);
            let n = [0, 1, 2].map(|k| out * e[k] + lift * axis[k]);
            self.lens
                .project(p)
                .map_or_else(Vertex::default, |at| Vertex {
                    at,
                    nearness: 1.0 / p[2],
                    colour: material.shaded(p, n, shade),
                })
        })
    }

    fn join(&mut self, material: &Material, last: Option<&Ring>, ring: &Ring) {
        let Some(last) = last else { return };
        for (old, new) in last.windows(2).zip(ring.windows(2)) {
            self.samples.triangle([&old[0], &old[1], &new[0]]);
            self.samples.triangle([&old[1], &new[1], &new[0]]);
            if let Some(band) = material.band {
                self.bands.push(band, [old[0], old[1], new[1], new[0]]);
            }
        }
    }
}
