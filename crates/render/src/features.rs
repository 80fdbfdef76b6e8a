use crate::raster::{Samples, Vertex};

/// Cells per side of a patch, each of which is hidden or visible as a whole.
const CELLS: u8 = 6;
/// A band with less visible area than this is not visible (px²).
const LEAST_AREA: f64 = 1.0;

/// Ground truth of bands A and B in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Centroids of the sides of the bands that face the camera, u and v of each, in px; NaN if nothing of a
    /// band is visible.
    pub features: [f64; 4],
    /// Share of these sides, by area in the image, that is inside the image and not occluded, 0 to 1.
    pub visible: [f64; 2],
}

/// A small piece of the side of a band that faces the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// 0 for band A, 1 for band B.
    pub band: usize,
    /// Position (px).
    pub at: [f32; 2],
    /// Area in the image (px²).
    pub area: f32,
    /// Inside the image and not occluded.
    pub seen: bool,
}

/// Surface patches of the bands.
///
/// Centroids are computed from the exact outlines of the patches, not from the samples of the image, whose
/// grid would shift them by up to 0.2 px.
#[derive(Default)]
pub(crate) struct Patches {
    patches: Vec<(usize, [Vertex; 4])>,
}

impl Patches {
    pub(crate) fn clear(&mut self) {
        self.patches.clear();
    }

    /// Adds a patch of band 0 or 1 with its corners in order.
    pub(crate) fn push(&mut self, band: usize, corners: [Vertex; 4]) {
        if corners.iter().all(|corner| corner.nearness > 0.0) {
            self.patches.push((band, corners));
        }
    }

    /// Centroids by area in the image, `sum(area of cell x position of cell) / sum(area of cell)`, and the
    /// visible share of the area. A cell is hidden if it is outside the image, or if something is drawn
    /// nearer by more than `tolerance` (m). Hidden cells count for the centroid, as in the loop's model: an
    /// occluding object does not move a band. Calls `keep` for every cell.
    pub(crate) fn truth(
        &self,
        samples: &Samples,
        tolerance: f32,
        mut keep: impl FnMut(Piece),
    ) -> Truth {
        let mut sums = [[0.0_f64; 4]; 2];
        for (band, corners) in &self.patches {
            let Some(sum) = sums.get_mut(*band) else {
                continue;
            };
            for (s, t) in (0..CELLS).flat_map(|i| (0..CELLS).map(move |j| (i, j))) {
                let [s, t] = [s, t].map(|i| (f32::from(i) + 0.5) / f32::from(CELLS));
                let cell = Cell::of(corners, s, t);
                let limit = cell.nearness / (1.0 - tolerance * cell.nearness).max(1e-3);
                let seen = !samples.hides(cell.at, limit);
                let area = f64::from(cell.area);
                sum[0] += area;
                sum[1] += area * f64::from(cell.at[0]);
                sum[2] += area * f64::from(cell.at[1]);
                sum[3] += if seen { area } else { 0.0 };
                keep(Piece {
                    band: *band,
                    at: cell.at,
                    area: cell.area / f32::from(CELLS).powi(2),
                    seen,
                });
            }
        }
        let visible = sums.map(|[area, _, _, seen]| {
            if seen < LEAST_AREA * f64::from(CELLS).powi(2) {
                0.0
            } else {
                seen / area
            }
        });
        let centre = |band: usize, k: usize| {
            if visible[band] > 0.0 {
                sums[band][k] / sums[band][0]
            } else {
                f64::NAN
            }
        };
        Truth {
            features: [centre(0, 1), centre(0, 2), centre(1, 1), centre(1, 2)],
            visible,
        }
    }
}

/// A point of a patch, and the area of the patch if all of it were like there.
struct Cell {
    at: [f32; 2],
    nearness: f32,
    area: f32,
}

impl Cell {
    fn of(corners: &[Vertex; 4], s: f32, t: f32) -> Self {
        let [a, b, c, d] = corners;
        let mix = |a: f32, b: f32, c: f32, d: f32| {
            (1.0 - t) * ((1.0 - s) * a + s * b) + t * ((1.0 - s) * d + s * c)
        };
        let along_s = |k: usize| (1.0 - t) * (b.at[k] - a.at[k]) + t * (c.at[k] - d.at[k]);
        let along_t = |k: usize| (1.0 - s) * (d.at[k] - a.at[k]) + s * (c.at[k] - b.at[k]);
        Self {
            at: [0, 1].map(|k| mix(a.at[k], b.at[k], c.at[k], d.at[k])),
            nearness: mix(a.nearness, b.nearness, c.nearness, d.nearness),
            area: (along_s(0) * along_t(1) - along_s(1) * along_t(0)).abs(),
        }
    }
}
