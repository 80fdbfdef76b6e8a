use crate::vector::{Vector, ZERO, add, norm, scale, sub, unit};

/// Arc length is tabulated at this many parameters per piece.
const KNOTS: usize = 4;
/// Nodes and weights of Gauss and Legendre on [0, 1].
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 4.0 / 9.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// One cubic Hermite piece, `p(t) = a + b t + c t² + d t³` with t in [0, 1].
struct Piece {
    a: Vector,
    b: Vector,
    c: Vector,
    d: Vector,
    /// Arc length of the whole curve where t is k / `KNOTS` (m).
    knots: [f64; KNOTS + 1],
}

impl Piece {
    /// Between two frames, with tangents as long as the chord: straight frames give a straight
    /// piece at constant speed, and the error of an arc of angle φ is at most its radius times φ⁴/128.
    fn between(p: [Vector; 2], t: [Vector; 2], start: f64) -> Option<Self> {
        let chord = sub(p[1], p[0]);
        let length = norm(chord);
        let along = unit(chord)?;
        let m = t.map(|t| scale(unit(t).unwrap_or(along), length));
        // 3 chord - 2 m0 - m1 and m0 + m1 - 2 chord, grouped so that straight gives exact zeros.
        let (e0, e1) = (sub(chord, m[0]), sub(chord, m[1]));
        let mut piece = Self {
            a: p[0],
            b: m[0],
            c: add(scale(e0, 2.0), e1),
            d: scale(add(e0, e1), -1.0),
            knots: [start; KNOTS + 1],
        };
        let step = 1.0 / KNOTS as f64;
        let mut s = start;
        for k in 0..KNOTS {
            let speed = |(node, weight)| weight * norm(piece.velocity((k as f64 + node) * step));
            s += step * GAUSS.into_iter().map(speed).sum::<f64>();
            piece.knots[k + 1] = s;
        }
        Some(piece)
    }

    fn end(&self) -> f64 {
        self.knots[KNOTS]
    }

    fn position(&self, t: f64) -> Vector {
        let high = add(self.c, scale(self.d, t));
        add(self.a, scale(add(self.b, scale(high, t)), t))
    }

    fn velocity(&self, t: f64) -> Vector {
        let high = add(scale(self.c, 2.0), scale(self.d, 3.0 * t));
        add(self.b, scale(high, t))
    }

    /// Position and unit tangent at arc length `s`.
    fn at(&self, s: f64) -> (Vector, Vector) {
        let k = self
            .knots
            .partition_point(|&knot| knot <= s)
            .clamp(1, KNOTS);
        let (low, high) = (self.knots[k - 1], self.knots[k]);
        let t = ((k - 1) as f64 + (s - low) / (high - low).max(1e-15)) / KNOTS as f64;
        let tangent = unit(self.velocity(t)).unwrap_or(unit(self.b).unwrap_or([0.0, 0.0, 1.0]));
        (self.position(t), tangent)
    }
}

/// The instrument's centreline through given frames, by arc length.
#[derive(Default)]
pub(crate) struct Curve {
    pieces: Vec<Piece>,
}

impl Curve {
    /// Joins frames (positions (m) and tangents), proximal to distal. Frames at the same position
    /// count once. The memory of an earlier curve is reused.
    pub(crate) fn fit(&mut self, frames: impl Iterator<Item = (Vector, Vector)>) {
        self.pieces.clear();
        let mut last: Option<(Vector, Vector)> = None;
        for (point, tangent) in frames {
            if let Some((from, direction)) = last {
                let start = self.length();
                match Piece::between([from, point], [direction, tangent], start) {
                    Some(piece) => self.pieces.push(piece),
                    None => continue,
                }
            }
            last = Some((point, tangent));
        }
    }

    /// Arc length (m).
    pub(crate) fn length(&self) -> f64 {
        self.pieces.last().map_or(0.0, Piece::end)
    }

    /// Position (m) and unit tangent at arc length `s` from the proximal end (m); clamped to the
    /// curve's ends.
    pub(crate) fn at(&self, s: f64) -> (Vector, Vector) {
        let s = s.clamp(0.0, self.length());
        let index = self.pieces.partition_point(|piece| piece.end() < s);
        self.pieces
            .get(index)
            .or(self.pieces.last())
            .map_or((ZERO, [0.0, 0.0, 1.0]), |piece| piece.at(s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_has_the_right_positions_and_length() {
        let (radius, angle, pieces) = (10e-3, 2.0, 10);
        let frame = |a: f64| {
            (
                [radius * (1.0 - a.cos()), 0.0, radius * a.sin()],
                [a.sin(), 0.0, a.cos()],
            )
        };
        let mut curve = Curve::default();
        curve.fit((0..=pieces).map(|i| frame(angle * f64::from(i) / f64::from(pieces))));
        assert!((curve.length() - radius * angle).abs() < 2e-5 * radius);
        for i in 0..100 {
            let a = angle * f64::from(i) / 99.0;
            let (place, tangent) = curve.at(radius * a);
            let (expected, direction) = frame(a);
            assert!(norm(sub(place, expected)) < 5e-5 * radius, "angle {a}");
            assert!(norm(sub(tangent, direction)) < 1e-3, "angle {a}");
        }
    }

    #[test]
    fn straight_frames_give_a_straight_line_parametrised_by_length() {
        let mut curve = Curve::default();
        let along = [0.6, 0.0, 0.8];
        curve.fit(
            [0.0, 1e-3, 7e-3, 7e-3, 30e-3]
                .map(|s| (scale(along, s), along))
                .into_iter(),
        );
        for i in 0..50 {
            let s = 30e-3 * f64::from(i) / 49.0;
            let (place, tangent) = curve.at(s);
            assert!(norm(sub(place, scale(along, s))) < 1e-15);
            assert!(norm(sub(tangent, along)) < 1e-12);
        }
    }
}
