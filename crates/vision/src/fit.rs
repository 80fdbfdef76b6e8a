//! The bands' outlines laid over what was segmented.

use crate::linear::{Square, apply, inverse};
use crate::numbers::real;
use crate::{Expectation, OUTLINE, Outline, RunMap};

/// Places along an outline where its edge is sought.
const SAMPLES: usize = 96;
/// How far from the outline an edge is sought (px), at most.
const REACH: f64 = 9.0;
/// Standard deviation of an edge (px), neighbours taken as independent.
const EDGE: f64 = 0.5;
/// Edges farther than this from where they should be have no say in the end (px).
const TOLERANCE: f64 = 1.8;
/// Standard deviation of the growth of the outlines: blur and threshold (px), and unknown scale (1).
const BLOOM: f64 = 1.2;
const SCALE: f64 = 0.06;
/// The same for the difference of the two bands: they are blurred alike. Of a band of which one rim is beyond the border
/// it says where along the axis it is.
const BLOOM_APART: f64 = 0.2;
const SCALE_APART: f64 = 0.01;
/// Edges nearer than this to the border of the image say nothing (px).
const BORDER: f64 = 2.0;
/// Nearer than this to where a rim meets a side the low-pass rounds the outline off (px).
const CORNER: f64 = 2.5;
/// Fewer samples of a rim than this say nothing of how much of it is there.
const FEW: f64 = 8.0;
/// Where they meet.
const CORNERS: [usize; 4] = [0, OUTLINE / 2 - 1, OUTLINE / 2, OUTLINE - 1];
/// The tolerance, round by round: from a region's centroid, and from where the outlines have lain before.
pub const COARSE: [f64; 3] = [4.0, 2.0, 1.4];
/// See [`COARSE`].
pub const FINE: [f64; 3] = [1.4, 1.0, 1.0];

/// Two outlines in place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Centroids `[u_A, v_A, u_B, v_B]` (px).
    pub features: [f64; 4],
    /// (4, 4) (px^2).
    pub covariance: Square<4>,
    /// How much each outline had to grow.
    pub bloom: [Bloom; 2],
    /// Share of each outline at which an edge was where it should be, of that in the image.
    pub edges: [f64; 2],
    /// The same of the rims alone; 1 where next to none of them is in the image.
    pub rims: [f64; 2],
    /// (d - expected)' inverse covariance (d - expected), 4 degrees of freedom.
    pub surprise: f64,
}

/// How much an outline had to grow (px): blur and threshold move the rims, beyond which the tip goes on, and the
/// sides, beyond which there is tissue, differently.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bloom {
    /// Along the axis.
    pub rims: f64,
    /// Across it.
    pub sides: f64,
}

/// Lays the outlines of `expected` over `map`, from centroids `start` on.
///
/// Robust least squares for the two places d and a growth b of each outline: with n the outward normal and
/// r the distance at which the markers' colour ends,
///
/// ```text
/// sum_k w(r_k - n_k d - b) (r_k - n_k d - b)^2 / EDGE^2 + (d - d0)' P^-1 (d - d0) + b^2 / B^2
/// ```
///
/// w is Tukey's weight, its width narrowing. So what hides a part of a band does not pull at it, and each
/// band says by the covariance P of the expectation where the other is. `seen` says which band has a say.
pub fn fit(
    expected: &Expectation,
    start: [f64; 4],
    seen: [bool; 2],
    rounds: [f64; 3],
    map: &RunMap,
) -> Option<Fit> {
    let prior = inverse(expected.covariance)?;
    let [a, b] = &expected.bands;
    let contours = [Contour::of(a), Contour::of(b)];
    let size = f64::midpoint(a.radius(), b.radius());
    let common = (BLOOM + SCALE * size).powi(-2);
    let apart = (BLOOM_APART + SCALE_APART * size).powi(-2);
    let mut place = start;
    let mut bloom = [0.0_f64; 4];
    let mut result = None;
    for width in rounds {
        let mut normal = [[0.0; 8]; 8];
        let mut right = [0.0; 8];
        let away = difference(expected.features, place);
        for (row, pull) in apply(&prior, away).into_iter().enumerate() {
            right[row] = pull;
            normal[row][..4].copy_from_slice(&prior[row]);
        }
        for (index, row) in normal.iter_mut().enumerate().skip(4) {
            let other = if index < 6 { index + 2 } else { index - 2 };
            row[index] = common + apart;
            row[other] = -apart;
        }
        let (mut edges, mut inside) = ([0.0; 2], [0.0; 2]);
        let (mut rims, mut rims_inside) = ([0.0; 2], [0.0; 2]);
        for (band, contour) in contours.iter().enumerate().filter(|(band, _)| seen[*band]) {
            let [u, v] = [place[2 * band], place[2 * band + 1]];
            for sample in contour.samples() {
                let grown = 2 * band + usize::from(sample.side);
                let tolerance = TOLERANCE * width;
                let reach = (tolerance + bloom[grown].abs()).min(contour.reach);
                let at = [u + sample.away[0], v + sample.away[1]];
                let offset = match edge(map, at, sample.normal, reach) {
                    Edge::Unknown => continue,
                    Edge::Missing => None,
                    Edge::At(offset) => Some(offset),
                };
                inside[band] += 1.0;
                rims_inside[band] += f64::from(u8::from(!sample.side));
                let Some(offset) = offset else { continue };
                let share = (offset - bloom[grown]) / tolerance;
                if share.abs() >= 1.0 {
                    continue;
                }
                edges[band] += 1.0;
                rims[band] += f64::from(u8::from(!sample.side));
                let weight = (1.0 - share * share).powi(2) / (EDGE * EDGE);
                let [nu, nv] = sample.normal;
                let row = [(2 * band, nu), (2 * band + 1, nv), (4 + grown, 1.0)];
                for (i, own) in row {
                    right[i] += weight * own * offset;
                    for (j, other) in row {
                        normal[i][j] += weight * own * other;
                    }
                }
            }
        }
        let covariance = inverse(normal)?;
        let [du_a, dv_a, du_b, dv_b, rims_a, sides_a, rims_b, sides_b] = apply(&covariance, right);
        bloom = [rims_a, sides_a, rims_b, sides_b];
        for (value, step) in place.iter_mut().zip([du_a, dv_a, du_b, dv_b]) {
            *value += step;
        }
        let away = difference(expected.features, place);
        let pull = apply(&prior, away);
        result = Some(Fit {
            features: place,
            covariance: [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| covariance[i][j])),
            bloom: [
                Bloom {
                    rims: rims_a,
                    sides: sides_a,
                },
                Bloom {
                    rims: rims_b,
                    sides: sides_b,
                },
            ],
            edges: [0, 1].map(|band| edges[band] / f64::max(inside[band], 1.0)),
            rims: [0, 1].map(|band| match rims_inside[band] {
                few if few < FEW => 1.0,
                count => rims[band] / count,
            }),
            surprise: pull.iter().zip(away).map(|(a, b)| a * b).sum(),
        });
    }
    result
}

/// The outline with its centroid there.
pub fn settle(outline: &Outline, [u, v]: [f64; 2]) -> Outline {
    let [cu, cv] = outline.centroid;
    outline.moved([u - cu, v - cv])
}

/// A place on an outline.
#[derive(Clone, Copy, Default)]
struct Sample {
    /// From the centroid (px).
    away: [f64; 2],
    /// Outward, of length 1.
    normal: [f64; 2],
    /// On a side, not on a rim.
    side: bool,
}

/// An outline at equal steps, but for where a rim meets a side.
struct Contour {
    samples: [Sample; SAMPLES],
    count: usize,
    /// How far from it an edge is sought (px).
    reach: f64,
}

impl Contour {
    fn of(outline: &Outline) -> Self {
        let [cu, cv] = outline.centroid;
        let corners = outline.corners.map(|[u, v]| [u - cu, v - cv]);
        let sides = || corners.iter().zip(corners.iter().cycle().skip(1));
        let around: f64 = sides()
            .map(|([u0, v0], [u1, v1])| (u1 - u0).hypot(v1 - v0))
            .sum();
        let signed: f64 = sides().map(|([u0, v0], [u1, v1])| u0 * v1 - u1 * v0).sum();
        let turn = signed.signum();
        let ends = CORNERS.map(|index| corners[index]);
        let step = around / real(SAMPLES);
        let mut contour = Self {
            samples: [Sample::default(); SAMPLES],
            count: 0,
            reach: REACH.min(0.8 * outline.radius()),
        };
        let mut due = step / 2.0;
        for (index, ([u0, v0], [u1, v1])) in sides().enumerate() {
            let (du, dv) = (u1 - u0, v1 - v0);
            let long = du.hypot(dv);
            while due < long {
                let away = [u0 + du * due / long, v0 + dv * due / long];
                due += step;
                let square = |[u, v]: [f64; 2]| (u - away[0]).powi(2) + (v - away[1]).powi(2);
                if ends.iter().any(|end| square(*end) < CORNER * CORNER) {
                    continue;
                }
                if let Some(place) = contour.samples.get_mut(contour.count) {
                    *place = Sample {
                        away,
                        normal: [turn * dv / long, -turn * du / long],
                        side: index % (OUTLINE / 2) == OUTLINE / 2 - 1,
                    };
                    contour.count += 1;
                }
            }
            due -= long;
        }
        contour
    }

    fn samples(&self) -> &[Sample] {
        self.samples.get(..self.count).unwrap_or_default()
    }
}

/// Where the markers' colour ends on a normal.
enum Edge {
    /// The image says nothing of it.
    Unknown,
    /// Not in reach.
    Missing,
    /// So far out (px).
    At(f64),
}

/// Where the markers' colour ends along `normal`, within `reach` (px).
fn edge(map: &RunMap, at: [f64; 2], normal: [f64; 2], reach: f64) -> Edge {
    let (width, height) = map.size();
    let within = |[u, v]: [f64; 2]| {
        (BORDER..width - 1.0 - BORDER).contains(&u) && (BORDER..height - 1.0 - BORDER).contains(&v)
    };
    if !within(at) {
        return Edge::Unknown;
    }
    let offset = crossing(map, at, normal, reach);
    // At the border of the image the colour ends whether the band does or not.
    let there = offset.unwrap_or_default();
    if within([at[0] + there * normal[0], at[1] + there * normal[1]]) {
        offset.map_or(Edge::Missing, Edge::At)
    } else {
        Edge::Unknown
    }
}

/// How far from `at` along `normal` the markers' colour ends, within `reach` (px).
fn crossing(map: &RunMap, at: [f64; 2], [nu, nv]: [f64; 2], reach: f64) -> Option<f64> {
    let marker = |along: f64| map.marker([at[0] + along * nu, at[1] + along * nv]);
    let inside = marker(0.0);
    let step: f64 = if inside { 0.5 } else { -0.5 };
    let mut along = step;
    while along.abs() <= reach {
        if marker(along) != inside {
            let middle = along - step / 2.0;
            let beyond = marker(middle) != inside;
            return Some(if beyond {
                middle - step / 4.0
            } else {
                middle + step / 4.0
            });
        }
        along += step;
    }
    None
}

fn difference([a0, a1, a2, a3]: [f64; 4], [b0, b1, b2, b3]: [f64; 4]) -> [f64; 4] {
    [a0 - b0, a1 - b1, a2 - b2, a3 - b3]
}
