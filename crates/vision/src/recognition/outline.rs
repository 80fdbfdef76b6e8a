//! Outlines of bands, and the pixels they enclose.

use crate::scan::RunMap;

/// Least share of an outline inside the image for which its centroid there is computed: that of a smaller piece depends
/// more on the pixel raster than on the position.
const LEAST_PIECE: f64 = 0.15;

/// Corners of an outline: half of them on each of its two arcs, the rims; one side joins their ends, one their starts.
pub const OUTLINE_CORNERS: usize = 26;
/// Corners on the proximal rim, the first; those on the distal rim have the opposite order.
pub const RIM: usize = OUTLINE_CORNERS / 2;

/// Outline of a band's visible side: two arcs, the rims, joined by two lines, the sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// Corners u, v in order (px).
    pub corners: [[f64; 2]; OUTLINE_CORNERS],
    /// Centroid of the enclosed area, u, v (px).
    pub centroid: [f64; 2],
    /// Enclosed area (px^2).
    pub area: f64,
}

impl Outline {
    /// The outline moved by `[u, v]` (px).
    pub(crate) fn moved(&self, [du, dv]: [f64; 2]) -> Self {
        let [u, v] = self.centroid;
        Self {
            corners: self.corners.map(|[u, v]| [u + du, v + dv]),
            centroid: [u + du, v + dv],
            area: self.area,
        }
    }

    /// The outline with its centroid at `[u, v]` (px).
    pub(crate) fn moved_to(&self, [u, v]: [f64; 2]) -> Self {
        let [cu, cv] = self.centroid;
        self.moved([u - cu, v - cv])
    }

    /// The outline scaled about its centroid, so that its mean radius grows by `reach` (px).
    pub(crate) fn grown(&self, reach: f64) -> Self {
        let factor = 1.0 + reach / self.radius();
        let [cu, cv] = self.centroid;
        Self {
            corners: self
                .corners
                .map(|[u, v]| [cu + factor * (u - cu), cv + factor * (v - cv)]),
            centroid: self.centroid,
            area: self.area * factor * factor,
        }
    }

    /// Radius of the circle of the same area (px).
    pub(crate) fn radius(&self) -> f64 {
        (self.area / std::f64::consts::PI).sqrt()
    }

    /// Counts the pixels inside the outline, the marker pixels, and those of them that are inside `other` too.
    pub(crate) fn count(&self, map: &RunMap, other: &Self) -> Count {
        let (width, _) = map.size();
        let mut count = Count::default();
        self.each_span(map, |v, from, to| {
            count.pixels += to - from + 1.0;
            count.marker += map.count(v, from, to);
            other.each_span_of_row(v, width, |first, last| {
                let (from, to) = (from.max(first), to.min(last));
                if from <= to {
                    count.shared += map.count(v, from, to);
                }
            });
        });
        count
    }

    /// Centroid u, v (px) of the part inside the image; None if that part is too small.
    pub(crate) fn centroid_within(&self, map: &RunMap) -> Option<[f64; 2]> {
        let (mut pixels, mut sum) = (0.0, [0.0; 2]);
        self.each_span(map, |v, from, to| {
            let count = to - from + 1.0;
            pixels += count;
            sum[0] += count * f64::midpoint(from, to);
            sum[1] += count * v;
        });
        (pixels > LEAST_PIECE * self.area).then(|| sum.map(|sum| sum / pixels))
    }

    /// Whether a point is inside.
    pub(crate) fn contains(&self, [u, v]: [f64; 2]) -> bool {
        let mut inside = false;
        self.each_crossing(v, |from, to| inside |= (from..=to).contains(&u));
        inside
    }

    /// Calls `visit(from, to)` for each part of row `v` inside the outline (px).
    pub(crate) fn each_crossing(&self, v: f64, mut visit: impl FnMut(f64, f64)) {
        // A row crosses each arc and each line at most twice.
        let mut crossings = [0.0; 8];
        let mut count = 0;
        let next = self.corners.iter().cycle().skip(1);
        for ([u0, v0], [u1, v1]) in self.corners.iter().zip(next) {
            if (*v0 <= v) != (*v1 <= v)
                && let Some(crossing) = crossings.get_mut(count)
            {
                *crossing = u0 + (v - v0) / (v1 - v0) * (u1 - u0);
                count += 1;
            }
        }
        let crossings = crossings.get_mut(..count).unwrap_or_default();
        crossings.sort_by(f64::total_cmp);
        for [from, to] in crossings.as_chunks().0 {
            visit(*from, *to);
        }
    }

    /// Calls `visit(v, first, last)` with the first and last pixel of each part of a row inside the outline and the image.
    fn each_span(&self, map: &RunMap, mut visit: impl FnMut(f64, f64, f64)) {
        let (width, height) = map.size();
        let [first, last] = extent(std::slice::from_ref(self), 1);
        let mut v = first.ceil().max(0.0);
        while v <= last.min(height - 1.0) {
            self.each_span_of_row(v, width, |from, to| visit(v, from, to));
            v += 1.0;
        }
    }

    fn each_span_of_row(&self, v: f64, width: f64, mut visit: impl FnMut(f64, f64)) {
        self.each_crossing(v, |from, to| {
            let (from, to) = (from.ceil().max(0.0), (to.ceil() - 1.0).min(width - 1.0));
            if from <= to {
                visit(from, to);
            }
        });
    }
}

/// The least and the largest coordinate of outlines along an axis, u or v (px).
pub(crate) fn extent(outlines: &[Outline], axis: usize) -> [f64; 2] {
    let corners = outlines.iter().flat_map(|outline| &outline.corners);
    corners.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], at| {
        [least.min(at[axis]), most.max(at[axis])]
    })
}

/// See [`Outline::count`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Count {
    /// Pixels of the image inside the outline (px).
    pub pixels: f64,
    /// Marker pixels among them (px).
    pub marker: f64,
    /// Marker pixels inside the other outline too (px).
    pub shared: f64,
}

#[cfg(test)]
#[path = "../../tests/units/outline.rs"]
mod tests;
