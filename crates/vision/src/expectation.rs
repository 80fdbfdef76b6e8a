//! What the loop expects to see: where, how large, how sure. Plain numbers, whoever made them.

use crate::numbers::{real, whole};
use crate::{Frame, RunMap, Window};

/// How far a band's colour may reach beyond its outline, motion and defocus included (px).
const BLUR: f64 = 12.0;

/// The piece of a band that the border of the image leaves says where the band is if it is more than this share of it.
const LEFT: f64 = 0.15;

/// Corners of an outline.
pub const OUTLINE: usize = 26;

/// What is expected of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expectation {
    /// Where the bands' centroids should be before anything is seen: `[u_A, v_A, u_B, v_B]` (px).
    pub features: [f64; 4],
    /// How sure that is: covariance (4, 4) (px^2), symmetric, positive definite.
    pub covariance: [[f64; 4]; 4],
    /// What the bands look like there, or where they were seen.
    pub bands: [Outline; 2],
}

impl Expectation {
    /// The part of a frame that holds both bands but for 3 standard deviations and their blur.
    ///
    /// None if that is more than a quarter of it: then the whole frame may as well be read.
    pub fn window(&self, frame: &impl Frame) -> Option<Window> {
        let [size_u, size_v] = [frame.width(), frame.height()].map(real);
        let [mut left, mut top, mut right, mut bottom] = [size_u, size_v, 0.0, 0.0];
        for (band, outline) in self.bands.iter().enumerate() {
            let spread = |axis: usize| {
                let variance = self.covariance[2 * band + axis][2 * band + axis];
                3.0 * variance.sqrt() + BLUR
            };
            let [away_u, away_v] = [0, 1].map(spread);
            let [shift_u, shift_v] =
                [0, 1].map(|axis| self.features[2 * band + axis] - outline.centroid[axis]);
            for [u, v] in outline.corners {
                left = left.min(u + shift_u - away_u);
                right = right.max(u + shift_u + away_u);
                top = top.min(v + shift_v - away_v);
                bottom = bottom.max(v + shift_v + away_v);
            }
        }
        let place = |value: f64, size: f64| whole(value.clamp(0.0, size));
        let window = Window {
            left: place(left.floor(), size_u),
            top: place(top.floor(), size_v),
            right: place(right.ceil(), size_u),
            bottom: place(bottom.ceil(), size_v),
        };
        let area = (right - left) * (bottom - top);
        let is_small = 4.0 * area <= size_u * size_v;
        (is_small && window.left < window.right && window.top < window.bottom).then_some(window)
    }
}

/// Whoever can say what to expect.
pub trait Expect {
    /// The expectation, its bands drawn in the posture that best explains the features `seen` (4,) (px)
    /// with standard deviations `deviation` (4,) (px; infinite: not seen).
    ///
    /// None if the bands cannot be seen.
    fn expect(&self, seen: [f64; 4], deviation: [f64; 4]) -> Option<Expectation>;
}

/// The outline of a band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline {
    /// Corners u, v, once around (px).
    pub corners: [[f64; 2]; OUTLINE],
    /// Mean place of what it encloses, u, v (px).
    pub centroid: [f64; 2],
    /// (px^2).
    pub area: f64,
}

impl Outline {
    /// Moved by `[u, v]` (px).
    #[must_use]
    pub fn moved(&self, [du, dv]: [f64; 2]) -> Self {
        let [u, v] = self.centroid;
        Self {
            corners: self.corners.map(|[u, v]| [u + du, v + dv]),
            centroid: [u + du, v + dv],
            area: self.area,
        }
    }

    /// Grown by `reach` px on average, about its centroid.
    #[must_use]
    pub fn grown(&self, reach: f64) -> Self {
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

    /// Radius of the circle of its area (px).
    pub fn radius(&self) -> f64 {
        (self.area / std::f64::consts::PI).sqrt()
    }

    /// Pixels of the image in it, those of them that are marker, and those of these that `other` has too.
    pub fn count(&self, map: &RunMap, other: &Self) -> Count {
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

    /// Mean place u, v (px) of the part of it that is in the image; None where that is too small a share of it.
    pub fn centroid_within(&self, map: &RunMap) -> Option<[f64; 2]> {
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
        (pixels > LEFT * self.area).then(|| sum.map(|sum| sum / pixels))
    }

    /// Whether a place is inside.
    pub fn contains(&self, [u, v]: [f64; 2]) -> bool {
        let mut inside = false;
        self.each_crossing(v, |from, to| inside |= (from..=to).contains(&u));
        inside
    }

    /// Where row `v` is inside, from and to (px).
    pub fn each_crossing(&self, v: f64, mut visit: impl FnMut(f64, f64)) {
        let spans = self.crossings(v);
        let pairs = spans.crossings.chunks_exact(2).take(spans.len / 2);
        for pair in pairs {
            if let [from, to] = pair {
                visit(*from, *to);
            }
        }
    }

    /// First and last row of an image so high that it may touch.
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

    /// Where row `v` is inside: pixels, whole numbers.
    fn spans(&self, v: f64, width: f64) -> Spans {
        let mut spans = self.crossings(v);
        spans.clip(width);
        spans
    }

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
pub struct Count {
    /// In the outline and in the image (px).
    pub pixels: f64,
    /// Marker among them (px).
    pub marker: f64,
    /// Marker in the other outline as well (px).
    pub shared: f64,
}

/// Where a row crosses an outline; no more crossings than an outline of two arcs can have.
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

    /// A rectangle of 20 x 20 px, its corners along two sides.
    fn square([u, v]: [f64; 2]) -> Outline {
        let side = OUTLINE / 2;
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
    fn the_border_moves_the_centroid_of_what_is_left() {
        let mut map = RunMap::default();
        map.start(100, 80);
        map.end_rows(80);
        // Centre; what of [u - 10, u + 10] is in [0, 99], and of [v - 10, v + 10] in [0, 79], has this middle.
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
