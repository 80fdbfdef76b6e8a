use crate::raster::{Samples, Vertex};

/// Cells per side into which a patch is divided to see how much of it is hidden.
const CELLS: u8 = 6;
/// A band that shows less than this is not visible (px²).
const LEAST: f64 = 1.0;

/// What a picture shows of bands A and B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Centroids of the bands' near sides, u and v of each, in px; NaN where nothing of a band is
    /// visible.
    pub features: [f64; 4],
    /// Share of each near side, by area in the picture, that is inside the picture with nothing in
    /// front of it, 0 to 1.
    pub visible: [f64; 2],
}

/// A small piece of a band's near side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// 0 for band A, 1 for band B.
    pub band: usize,
    /// Place (px).
    pub at: [f32; 2],
    /// Area in the picture (px²).
    pub area: f32,
    /// Inside the picture with nothing in front of it.
    pub seen: bool,
}

/// The bands' surface as it was drawn, patch by patch.
///
/// Centroids come from the patches' exact outlines and not from the picture's samples, whose grid
/// would shift them by up to 0.2 px.
#[derive(Default)]
pub(crate) struct Patches {
    patches: Vec<(usize, [Vertex; 4])>,
}

impl Patches {
    pub(crate) fn clear(&mut self) {
        self.patches.clear();
    }

    /// Remembers a patch of band 0 or 1 with its corners in order around it.
    pub(crate) fn push(&mut self, band: usize, corners: [Vertex; 4]) {
        if corners.iter().all(|corner| corner.nearness > 0.0) {
            self.patches.push((band, corners));
        }
    }

    /// Centroids by area in the picture, `sum(area of cell x place of cell) / sum(area of cell)`,
    /// and the share of it that is seen. A cell is hidden where something is drawn nearer than it
    /// by more than `slack` (m), or outside the picture. Hidden cells count for the centroid: the
    /// loop's model predicts that of the whole near side, and what hides a part moves no band.
    /// Every cell is handed to `keep`.
    pub(crate) fn truth(
        &self,
        samples: &Samples,
        slack: f32,
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
                let limit = cell.nearness / (1.0 - slack * cell.nearness).max(1e-3);
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
            if seen < LEAST * f64::from(CELLS).powi(2) {
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

/// A place on a patch, and how large the patch would be were it all like there.
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
