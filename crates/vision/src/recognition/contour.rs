//! Sample points along an outline, and the edges of the marker pixels near them.

use super::outline::{OUTLINE_CORNERS, Outline, RIM};
use crate::math::real;
use crate::scan::RunMap;

/// Sample points of an outline: about one per pixel of its length.
const SAMPLES: usize = 96;
/// Edges nearer than this to the border of the image are ignored (px): the low-pass of the replicated border moves them.
const BORDER: f64 = 2.0;
/// Samples nearer than this to where a rim meets a side are left out (px): the low-pass rounds the marker off there.
const CORNER: f64 = 2.5;

/// A point on an outline.
#[derive(Clone, Copy, Default)]
pub struct Sample {
    /// From the centroid (px).
    pub offset: [f64; 2],
    /// Outward unit normal.
    pub normal: [f64; 2],
    /// On a side, not on a rim.
    pub is_side: bool,
}

/// Sample points at equal steps along an outline.
pub struct Contour {
    samples: [Sample; SAMPLES],
    count: usize,
    /// Distance up to which edges are searched (px).
    pub reach: f64,
}

impl Contour {
    /// Samples an outline; edges are searched up to `reach` (px).
    pub fn of(outline: &Outline, reach: f64) -> Self {
        let [cu, cv] = outline.centroid;
        let corners = outline.corners.map(|[u, v]| [u - cu, v - cv]);
        let lines = || corners.iter().zip(corners.iter().cycle().skip(1));
        let length: f64 = lines()
            .map(|([u0, v0], [u1, v1])| (u1 - u0).hypot(v1 - v0))
            .sum();
        let signed: f64 = lines().map(|([u0, v0], [u1, v1])| u0 * v1 - u1 * v0).sum();
        let turn = signed.signum();
        let ends = [0, RIM - 1, RIM, OUTLINE_CORNERS - 1].map(|index| corners[index]);
        let step = length / real(SAMPLES);
        let mut contour = Self {
            samples: [Sample::default(); SAMPLES],
            count: 0,
            // Farther inwards are the edges of the opposite side.
            reach: reach.min(0.8 * outline.radius()),
        };
        let mut next = step / 2.0;
        for (index, ([u0, v0], [u1, v1])) in lines().enumerate() {
            let (du, dv) = (u1 - u0, v1 - v0);
            let length = du.hypot(dv);
            while next < length {
                let offset = [u0 + du * next / length, v0 + dv * next / length];
                next += step;
                let square = |[u, v]: [f64; 2]| (u - offset[0]).powi(2) + (v - offset[1]).powi(2);
                if ends.iter().any(|end| square(*end) < CORNER * CORNER) {
                    continue;
                }
                if let Some(sample) = contour.samples.get_mut(contour.count) {
                    *sample = Sample {
                        offset,
                        normal: [turn * dv / length, -turn * du / length],
                        is_side: index % RIM == RIM - 1,
                    };
                    contour.count += 1;
                }
            }
            next -= length;
        }
        contour
    }

    /// The sample points.
    pub fn samples(&self) -> &[Sample] {
        self.samples.get(..self.count).unwrap_or_default()
    }
}

/// How far outwards the edge of the marker pixels is along `normal` from `at` (px), infinity if there is none within `reach`;
/// None where the image does not show it.
pub fn find_edge(map: &RunMap, at: [f64; 2], normal: [f64; 2], reach: f64) -> Option<f64> {
    let (width, height) = map.size();
    let is_within = |[u, v]: [f64; 2]| {
        (BORDER..width - 1.0 - BORDER).contains(&u) && (BORDER..height - 1.0 - BORDER).contains(&v)
    };
    if !is_within(at) {
        return None;
    }
    let Some(offset) = crossing(map, at, normal, reach) else {
        return Some(f64::INFINITY);
    };
    // At the border of the image the colour ends whether the band does or not.
    is_within([at[0] + offset * normal[0], at[1] + offset * normal[1]]).then_some(offset)
}

/// Distance from `at` along `normal` to the edge, within `reach` (px), in steps of half a pixel that are halved once.
fn crossing(map: &RunMap, at: [f64; 2], [nu, nv]: [f64; 2], reach: f64) -> Option<f64> {
    let marker = |along: f64| map.is_marker([at[0] + along * nu, at[1] + along * nv]);
    let inside = marker(0.0);
    let step: f64 = if inside { 0.5 } else { -0.5 };
    let mut along = step;
    while along.abs() <= reach {
        if marker(along) != inside {
            let middle = along - step / 2.0;
            let is_beyond = marker(middle) != inside;
            let half = if is_beyond { -0.25 } else { 0.25 };
            return Some(middle + half * step);
        }
        along += step;
    }
    None
}
