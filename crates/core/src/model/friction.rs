//! Friction of a round shaft in its channel: a vector play of insertion and rotation.

use crate::math::linear::square;

/// Newton steps at most; three suffice for a control tick.
const STEPS: usize = 20;
/// Error of the angle in rad at which Newton's method ends.
const PRECISION: f64 = 1e-12;

/// Deflection of the shaft over its half widths after a straight motion of the command.
///
/// Coulomb friction has one magnitude, along and around the shaft together. With the deflection
/// e = command - output of insertion and rotation, half widths h and the shaft's radius r,
///
/// ```text
/// n = (e1 / h1, e2 / h2),  |n| <= 1;   the shaft slides only where |n| = 1, along (dq1, r dq2) = n dl,  dl >= 0
/// ```
///
/// (friction ellipse as limit surface: Goyal, Ruina, Papadopoulos, Wear 143, 1991; as a vector play it is Bergqvist's
/// hysteresis, Physica B 233, 1997). For a straight motion d = (dc1 / h1, dc2 / h2) of the command the sliding part is
/// solved exactly: n turns by the angle phi from its steady direction, (k d1, d2) with k = h1 / (r h2), as
///
/// ```text
/// p x + q cos(phi) - s sin(phi) = const - |(k d1, d2)| t,   x = ln tan(phi / 2)
/// ```
///
/// which Newton's method in x solves, because its slope lies between 1 and k. With one DOF at rest it is the play of
/// Eq. (1).
///
/// `deflection` and `motion` are n and d (2,), `ratio` is k. Wrong while viscous friction is not small.
pub fn slide(deflection: [f64; 2], motion: [f64; 2], ratio: f64) -> [f64; 2] {
    let ([n1, n2], [d1, d2]) = (deflection, motion);
    let free = [n1 + d1, n2 + d2];
    let length_squared = square(d1) + square(d2);
    if norm_squared(free) <= 1.0 || length_squared == 0.0 {
        return free;
    }
    // The part of the motion before the shaft slides: a root of |n + reach d|^2 = 1.
    let along = n1 * d1 + n2 * d2;
    let inside = (1.0 - norm_squared(deflection)).max(0.0);
    let root = libm::sqrt(square(along) + length_squared * inside);
    let reach = if along > 0.0 {
        inside / (along + root)
    } else {
        (root - along) / length_squared
    };
    let reach = reach.clamp(0.0, 1.0);
    let start = unit([n1 + reach * d1, n2 + reach * d2]);
    turn(start, [ratio * d1, d2], ratio, 1.0 - reach)
}

/// Turns the deflection n, |n| = 1, over a share of the motion towards `drive` = (k d1, d2).
fn turn([n1, n2]: [f64; 2], drive: [f64; 2], ratio: f64, share: f64) -> [f64; 2] {
    let [c, s] = unit(drive);
    let (cos, sin) = (n1 * c + n2 * s, c * n2 - s * n1);
    let (side, sin) = (sin.signum(), sin.abs());
    let tangent = sin / (1.0 + cos);
    if tangent.is_nan() || tangent < PRECISION {
        return [c, s];
    }
    let half = 0.5 * (1.0 - ratio);
    let (along, across) = (half * (c * c - s * s), half * 2.0 * c * s * side);
    let p = 0.5 * (1.0 + ratio) + along;
    let slope = |cos: f64, sin: f64| p - 2.0 * sin * (along * sin + across * cos);
    let bent = |cos: f64, sin: f64| 2.0 * (along * cos - across * sin);
    let goal = bent(cos, sin) - share * libm::sqrt(norm_squared(drive));
    // x less its value at the start.
    let mut x = (goal - bent(cos, sin)) / slope(cos, sin);
    let (mut cos, mut sin) = (cos, sin);
    for _ in 0..STEPS {
        let tangent = tangent * libm::exp(x);
        let square = tangent * tangent;
        (cos, sin) = (
            (1.0 - square) / (1.0 + square),
            2.0 * tangent / (1.0 + square),
        );
        let step = (p * x + bent(cos, sin) - goal) / slope(cos, sin);
        if step.abs() < PRECISION {
            break;
        }
        x -= step;
    }
    let sin = side * sin;
    [c * cos - s * sin, s * cos + c * sin]
}

fn norm_squared([a, b]: [f64; 2]) -> f64 {
    a * a + b * b
}

/// The vector scaled to length 1.
fn unit([a, b]: [f64; 2]) -> [f64; 2] {
    let length = libm::sqrt(a * a + b * b);
    [a / length, b / length]
}
