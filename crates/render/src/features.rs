use crate::raster::{Samples, Vertex};

/// Cells per side into which a patch is divided to see how much of it is hidden.
const CELLS: u8 = 6;
/// A band that shows less than this is not visible (px²).
const LEAST: f64 = 1.0;

/// Centroids of the visible part of bands A and B, u and v of each, in px; NaN where not visible.
pub type Features = [f64; 4];

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

    /// Centroids by visible area in the picture,
    /// `sum(area of cell x place of cell) / sum(area of cell)`; a cell is hidden where something
    /// is drawn nearer than it by more than `slack` (m), or outside the picture.
    pub(crate) fn centroids(&self, samples: &Samples, slack: f32) -> Features {
        let mut sums = [[0.0_f64; 3]; 2];
        for (band, corners) in &self.patches {
            let Some(sum) = sums.get_mut(*band) else {
                continue;
            };
            for (s, t) in (0..CELLS).flat_map(|i| (0..CELLS).map(move |j| (i, j))) {
                let [s, t] = [s, t].map(|i| (f32::from(i) + 0.5) / f32::from(CELLS));
                let cell = Cell::of(corners, s, t);
                let limit = cell.nearness / (1.0 - slack * cell.nearness).max(1e-3);
                if !samples.hides(cell.at, limit) {
                    let area = f64::from(cell.area);
                    sum[0] += area;
                    sum[1] += area * f64::from(cell.at[0]);
                    sum[2] += area * f64::from(cell.at[1]);
                }
            }
        }
        let [a, b] = sums.map(|[area, x, y]| {
            if area < LEAST * f64::from(CELLS).powi(2) {
                [f64::NAN; 2]
            } else {
                [x / area, y / area]
            }
        });
        [a[0], a[1], b[0], b[1]]
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
