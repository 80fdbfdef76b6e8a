//! Postures of the whole workspace, compared with the regions of an image where nothing else predicts the bands.

use super::outline::{Outline, extent};
use super::starts::{Candidate, Ranking, TRIALS, rank};
use crate::math::{is_near, real, real_sum, single};
use crate::scan::Region;

/// Largest distance of a region from a posture's band (px): the postures of the table are this far apart.
const REACH: f32 = 30.0;
/// Standard deviation of that distance (px).
const POSITION_STD: f32 = 15.0;
/// Standard deviation of the vector between the bands (px): of the table's steps and of occlusion.
const VECTOR_STD: f32 = 6.0;
/// Largest error of that vector (px).
const VECTOR_REACH: f32 = 24.0;
/// Standard deviation of the logarithm of an area, and the largest cost of it.
const AREA_STD: f32 = 0.4;
const LARGEST_AREA_COST: f32 = 9.0;
/// Standard deviation of a side of the bounding box, relative to it and in px, and the largest cost of it.
const SIDE_SHARE: f32 = 0.2;
const SIDE_STD: f32 = 2.0;
const LARGEST_SIDE_COST: f32 = 4.0;
/// Cost of a band without a region.
const MISSING_COST: f32 = 16.0;

/// Postures of the workspace with the size and the place of both bands in the image.
#[derive(Clone, Debug, Default)]
pub struct PostureTable {
    postures: Vec<Posture>,
}

/// The image of both bands in a posture.
#[derive(Clone, Copy, Debug)]
struct Posture {
    bands: [Shape; 2],
    both: Shape,
}

/// Place and size of what has the markers' colour.
#[derive(Clone, Copy, Debug)]
struct Shape {
    centroid: [f32; 2],
    log_area: f32,
    /// Sides of the bounding box.
    sides: [f32; 2],
}

/// Postures that are kept of bands in one region.
pub const BLOBS: usize = 6;
/// Postures whose features differ by less than this are the same (px).
const BLOB_DISTANCE: f64 = 5.0;

/// Features of the likeliest postures of bands that are one region (px).
pub type BlobPostures = Ranking<[f64; 4], BLOBS>;

impl Posture {
    /// Features of the posture, moved by `offset` (px).
    fn features(&self, offset: [f32; 2]) -> [f64; 4] {
        let [a, b] = self
            .bands
            .map(|band| [0, 1].map(|axis| f64::from(band.centroid[axis] + offset[axis])));
        [a[0], a[1], b[0], b[1]]
    }
}

impl Shape {
    fn of(outlines: &[Outline]) -> Self {
        let area: f64 = outlines.iter().map(|outline| outline.area).sum();
        let side = |axis: usize| {
            let [first, last] = extent(outlines, axis);
            last - first
        };
        let centroid = |axis: usize| {
            let moments = outlines.iter().map(|one| one.area * one.centroid[axis]);
            moments.sum::<f64>() / area
        };
        Self {
            centroid: [0, 1].map(|axis| single(centroid(axis))),
            log_area: single(area.ln()),
            sides: [0, 1].map(|axis| single(side(axis))),
        }
    }

    fn of_region(region: &Region) -> Self {
        let sides = [region.right - region.left, region.bottom - region.top];
        Self {
            centroid: region.centroid().map(single),
            log_area: single(real_sum(region.area).ln()),
            sides: sides.map(|side| single(real(side))),
        }
    }

    fn offset(&self, other: &Self) -> [f32; 2] {
        [0, 1].map(|axis| self.centroid[axis] - other.centroid[axis])
    }

    /// Offset from where a shape is expected, and the cost of offset and size; None if it is too far away.
    fn cost(&self, expected: &Self) -> Option<([f32; 2], f32)> {
        let offset = self.offset(expected);
        let square = square(offset);
        let cost = square / (POSITION_STD * POSITION_STD) + self.size_cost(expected);
        (square < REACH * REACH).then_some((offset, cost))
    }

    /// How badly sizes agree: part of a band may be hidden.
    fn size_cost(&self, expected: &Self) -> f32 {
        let area = ((self.log_area - expected.log_area) / AREA_STD).powi(2);
        let side = |axis: usize| {
            let (own, other) = (self.sides[axis], expected.sides[axis]);
            ((own - other) / (SIDE_STD + SIDE_SHARE * other))
                .powi(2)
                .min(LARGEST_SIDE_COST)
        };
        area.min(LARGEST_AREA_COST) + side(0) + side(1)
    }
}

fn square([u, v]: [f32; 2]) -> f32 {
    u * u + v * v
}

impl PostureTable {
    /// From the outlines of both bands in postures that cover the workspace.
    pub fn new(outlines: impl Iterator<Item = [Outline; 2]>) -> Self {
        let postures = outlines.map(|both| Posture {
            bands: [Shape::of(&both[..1]), Shape::of(&both[1..])],
            both: Shape::of(&both),
        });
        Self {
            postures: postures.collect(),
        }
    }

    /// Whether there is no posture.
    pub fn is_empty(&self) -> bool {
        self.postures.is_empty()
    }

    /// The likeliest pairs of regions. Postures of both bands in one region are ranked in `blobs` too.
    pub fn likely_pairs(
        &self,
        regions: &[Region],
        blobs: &mut BlobPostures,
    ) -> Ranking<Candidate, TRIALS> {
        let mut kept = [None; TRIALS];
        let mut shapes = [None; crate::scan::MAX_REGIONS];
        for (shape, region) in shapes.iter_mut().zip(regions) {
            *shape = Some(Shape::of_region(region));
        }
        let shapes = || shapes.iter().flatten().enumerate();
        for posture in &self.postures {
            let mut keep = |cost: f32, pair, offset| {
                let features = posture.features(offset);
                rank(&mut kept, cost.into(), (pair, features), |other| {
                    other.0 == pair
                });
            };
            let [a, b] = &posture.bands;
            for (index, shape) in shapes() {
                if let Some((offset, cost)) = shape.cost(a) {
                    for (other, second) in shapes().filter(|(other, _)| *other != index) {
                        let [u, v] = second.offset(b);
                        let error = square([u - offset[0], v - offset[1]]);
                        if error < VECTOR_REACH * VECTOR_REACH {
                            let both =
                                cost + error / (VECTOR_STD * VECTOR_STD) + second.size_cost(b);
                            keep(both, [Some(index), Some(other)], offset);
                        }
                    }
                    keep(cost + MISSING_COST, [Some(index), None], offset);
                }
                if let Some((offset, cost)) = shape.cost(b) {
                    keep(cost + MISSING_COST, [None, Some(index)], offset);
                }
                if let Some((offset, cost)) = shape.cost(&posture.both) {
                    keep(cost, [Some(index); 2], offset);
                    let features = posture.features(offset);
                    let same = |other: &[f64; 4]| is_near(&features, other, BLOB_DISTANCE);
                    rank(blobs, cost.into(), features, same);
                }
            }
        }
        kept
    }
}
