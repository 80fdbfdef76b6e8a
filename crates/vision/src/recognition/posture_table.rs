//! Postures of the whole workspace, compared with the regions of an image where nothing else predicts the bands.

use super::outline::Outline;
use super::pairing::{Pair, TRIALS};
use crate::math::{real, real_sum, single};
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

/// Likeliest postures of bands that are one region, the likeliest first, with their costs.
pub type BlobPostures = [Option<(f32, [f64; 4])>; BLOBS];

/// Regions that may be the bands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Regions of the bands.
    pub pair: Pair,
    /// Features of the posture, moved to the regions (px).
    pub features: [f64; 4],
}

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
        let corners = || outlines.iter().flat_map(|outline| outline.corners);
        let side = |axis: usize| {
            let values = || corners().map(|corner| corner[axis]);
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
        };
        let centroid = |axis: usize| {
            let sum: f64 = outlines
                .iter()
                .map(|outline| outline.area * outline.centroid[axis])
                .sum();
            sum / area
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

    /// The likeliest pairs of regions, the likeliest first.
    ///
    /// Postures of both bands in one region are kept in `blobs` too.
    pub fn likely_pairs(
        &self,
        regions: &[Region],
        blobs: &mut BlobPostures,
    ) -> [Option<Candidate>; TRIALS] {
        let mut kept: [Option<(f32, Candidate)>; TRIALS] = [None; TRIALS];
        let mut shapes = [None; crate::scan::MAX_REGIONS];
        for (shape, region) in shapes.iter_mut().zip(regions) {
            *shape = Some(Shape::of_region(region));
        }
        let shapes = || shapes.iter().flatten().enumerate();
        for posture in &self.postures {
            let [a, b] = &posture.bands;
            for (index, shape) in shapes() {
                let offset = shape.offset(a);
                if square(offset) < REACH * REACH {
                    let cost = square(offset) / (POSITION_STD * POSITION_STD) + shape.size_cost(a);
                    for (other, second) in shapes().filter(|(other, _)| *other != index) {
                        let [u, v] = second.offset(b);
                        let error = square([u - offset[0], v - offset[1]]);
                        if error < VECTOR_REACH * VECTOR_REACH {
                            let cost =
                                cost + error / (VECTOR_STD * VECTOR_STD) + second.size_cost(b);
                            keep(&mut kept, cost, [Some(index), Some(other)], posture, offset);
                        }
                    }
                    keep(
                        &mut kept,
                        cost + MISSING_COST,
                        [Some(index), None],
                        posture,
                        offset,
                    );
                }
                let offset = shape.offset(b);
                if square(offset) < REACH * REACH {
                    let cost = square(offset) / (POSITION_STD * POSITION_STD) + shape.size_cost(b);
                    keep(
                        &mut kept,
                        cost + MISSING_COST,
                        [None, Some(index)],
                        posture,
                        offset,
                    );
                }
                let offset = shape.offset(&posture.both);
                if square(offset) < REACH * REACH {
                    let cost = square(offset) / (POSITION_STD * POSITION_STD)
                        + shape.size_cost(&posture.both);
                    keep(&mut kept, cost, [Some(index); 2], posture, offset);
                    keep_blob(blobs, cost, posture, offset);
                }
            }
        }
        kept.map(|one| one.map(|(_, candidate)| candidate))
    }
}

/// Keeps the best posture of each pair.
fn keep(
    kept: &mut [Option<(f32, Candidate)>; TRIALS],
    cost: f32,
    pair: Pair,
    posture: &Posture,
    offset: [f32; 2],
) {
    if kept[TRIALS - 1].is_some_and(|(most, _)| cost >= most) {
        return;
    }
    let same = kept
        .iter()
        .position(|one| one.is_some_and(|(_, other)| other.pair == pair));
    if same.is_some_and(|index| kept[index].is_some_and(|(less, _)| less <= cost)) {
        return;
    }
    let last = same.unwrap_or(TRIALS - 1);
    let rank = kept
        .iter()
        .position(|one| one.is_none_or(|(less, _)| cost < less))
        .unwrap_or(last);
    kept[rank..=last].rotate_right(1);
    let features = posture.features(offset);
    kept[rank] = Some((cost, Candidate { pair, features }));
}

/// Keeps the best of postures that are nearly the same.
fn keep_blob(kept: &mut BlobPostures, cost: f32, posture: &Posture, offset: [f32; 2]) {
    if kept[BLOBS - 1].is_some_and(|(most, _)| cost >= most) {
        return;
    }
    let features = posture.features(offset);
    let is_same = |other: &[f64; 4]| {
        (0..4).all(|index| (features[index] - other[index]).abs() < BLOB_DISTANCE)
    };
    let same = kept
        .iter()
        .position(|one| one.is_some_and(|(_, other)| is_same(&other)));
    if same.is_some_and(|index| kept[index].is_some_and(|(less, _)| less <= cost)) {
        return;
    }
    let last = same.unwrap_or(BLOBS - 1);
    let rank = kept
        .iter()
        .position(|one| one.is_none_or(|(less, _)| cost < less))
        .unwrap_or(last);
    kept[rank..=last].rotate_right(1);
    kept[rank] = Some((cost, features));
}
