//! Outlines of bands, and the pixels they enclose.

use crate::scan::RunMap;

/// Least share of an outline inside the image for which its centroid there is computed: that of a smaller piece depends
/// more on the pixel raster than on the position.
const LEAST_PIECE: f64 = 0.15;

/// Corners of an outline: 13 on each of its two arcs, the rims; one side joins their ends, one their starts.
pub const OUTLINE_CORNERS: usize = 26;

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
        let (width, height) = map.size();
        let mut count = Count::default();
        let (mut v, last) = self.rows(height);
        while v <= last {
            let mine = self.spans(v, width);
            let theirs = other.spans(v, width);
            for (from, to) in mine.each() {
                count.pixels += to - from + 1.0;
                count.marker += map.count(v, from, to);
                for (first, last) in theirs.each() {
                    let (from, to) = (from.max(first), to.min(last));
                    if from <= to {
                        count.shared += map.count(v, from, to);
                    }
                }
            }
            v += 1.0;
        }
        count
    }

    /// Centroid u, v (px) of the part inside the image; None if that part is too small.
    pub(crate) fn centroid_within(&self, map: &RunMap) -> Option<[f64; 2]> {
        let (width, height) = map.size();
        let (mut pixels, mut sum) = (0.0, [0.0; 2]);
        let (mut v, last) = self.rows(height);
        while v <= last {
            for (from, to) in self.spans(v, width).each() {
                let count = to - from + 1.0;
                pixels += count;
                sum[0] += count * f64::midpoint(from, to);
                sum[1] += count * v;
            }
            v += 1.0;
        }
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
        let spans = self.crossings(v);
        let pairs = spans.crossings.chunks_exact(2).take(spans.len / 2);
        for pair in pairs {
            if let [from, to] = pair {
                visit(*from, *to);
            }
        }
    }

    /// First and last row of an image of this height (px) that the outline may touch.
    fn rows(&self, height: f64) -> (f64, f64) {
        let extreme = |pick: fn(f64, f64) -> f64, start| {
            self.corners.iter().map(|[_, v]| *v).fold(start, pick)
        };
        let first = extreme(f64::min, f64::INFINITY).ceil().max(0.0);
        (
            first,
            extreme(f64::max, f64::NEG_INFINITY).min(height - 1.0),
        )
    }

    /// First and last pixels of the parts of row `v` inside the outline.
    fn spans(&self, v: f64, width: f64) -> Spans {
        let mut spans = self.crossings(v);
        spans.clip(width);
        spans
    }

    /// Where row `v` crosses the outline.
    fn crossings(&self, v: f64) -> Spans {
        let mut spans = Spans::default();
        let next = self.corners.iter().cycle().skip(1);
        for ([u0, v0], [u1, v1]) in self.corners.iter().zip(next) {
            if (*v0 <= v) != (*v1 <= v) {
                spans.add(u0 + (v - v0) / (v1 - v0) * (u1 - u0));
            }
        }
        spans.sort();
        spans
    }
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

/// Crossings of a row with an outline: each arc and each line has at most two.
#[derive(Default)]
struct Spans {
    crossings: [f64; 8],
    len: usize,
}

impl Spans {
    fn add(&mut self, u: f64) {
        if let Some(slot) = self.crossings.get_mut(self.len) {
            *slot = u;
            self.len += 1;
        }
    }

    fn sort(&mut self) {
        let crossings = self.crossings.get_mut(..self.len).unwrap_or_default();
        crossings.sort_by(f64::total_cmp);
    }

    fn clip(&mut self, width: f64) {
        let crossings = self.crossings.get_mut(..self.len).unwrap_or_default();
        for (index, u) in crossings.iter_mut().enumerate() {
            *u = if index % 2 == 0 {
                u.ceil().max(0.0)
            } else {
                (u.ceil() - 1.0).min(width - 1.0)
            };
        }
    }

    fn each(&self) -> impl Iterator<Item = (f64, f64)> {
        let pairs = self.crossings.chunks_exact(2).take(self.len / 2);
        pairs.filter_map(|pair| match pair {
            [from, to] if from <= to => Some((*from, *to)),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::real;

    /// A rectangle of 20 x 20 px, its corners along two sides.
    fn square([u, v]: [f64; 2]) -> Outline {
        let side = OUTLINE_CORNERS / 2;
        let corner = |index: usize| {
            let share = 20.0 * real(index % side) / real(side - 1) - 10.0;
            if index < side {
                [u + share, v - 10.0]
            } else {
                [u - share, v + 10.0]
            }
        };
        Outline {
            corners: std::array::from_fn(corner),
            centroid: [u, v],
            area: 400.0,
        }
    }

    #[test]
    fn centroid_within_is_that_of_the_part_in_the_image() {
        let mut map = RunMap::default();
        map.start(100, 80);
        map.end_rows(80);
        // Centre of the square, and the middle of its part in [0, 99] x [0, 79].
        for ([u, v], middle) in [
            ([50.0, 40.0], [50.0, 40.0]),
            ([0.0, 40.0], [5.0, 40.0]),
            ([95.0, 77.0], [92.0, 73.0]),
        ] {
            let [seen_u, seen_v] = square([u, v]).centroid_within(&map).unwrap();
            let off = (seen_u - middle[0]).hypot(seen_v - middle[1]);
            assert!(off < 0.8, "{u} {v}: {seen_u} {seen_v}");
        }
        assert_eq!(square([50.0, 88.0]).centroid_within(&map), None);
        assert_eq!(square([300.0, 40.0]).centroid_within(&map), None);
    }
}
