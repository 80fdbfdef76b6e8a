//! Straight pieces of the path of the command.

use crate::dof::PerDof;

/// Largest distance of the path from its straight pieces, in half of `width_limit`.
const TOLERANCE: f64 = 2e-3;
/// Length of a piece that gets no further tick, in half of `width_limit`.
const LENGTH: f64 = 0.1;

/// Ends of the straight pieces of a path of commands [m, rad, rad] from `from` on, in units `unit` (3,).
///
/// Plays do not depend on the rate: of ticks along a straight line only the last counts, at a fraction of the time. A tick
/// ends a piece if the shaft's path (insertion and rotation) turns back there, or if bending does, or if the sum of the
/// distances of such ticks from the piece would exceed 0.002 units, or if it is 0.1 units long: where DOFs share a part of
/// their friction, the shaft may turn back while the command goes straight on.
pub fn straight_pieces(
    path: impl Iterator<Item = PerDof<f64>>,
    from: PerDof<f64>,
    unit: PerDof<f64>,
) -> impl Iterator<Item = PerDof<f64>> {
    let mut path = path.peekable();
    let mut start = from;
    core::iter::from_fn(move || {
        let mut end = path.next()?;
        let mut off = 0.0;
        while let Some(next) = path.peek() {
            let [a1, a2, a3] = scaled(start, end, unit);
            let [b1, b2, b3] = scaled(end, *next, unit);
            let (along, across) = (a1 * b1 + a2 * b2, (a1 * b2 - a2 * b1).abs());
            let length = libm::hypot(a1 + b1, a2 + b2);
            off += if across > 0.0 { across / length } else { 0.0 };
            if along < 0.0 || a3 * b3 < 0.0 || off > TOLERANCE || length > LENGTH {
                break;
            }
            end = *next;
            path.next();
        }
        start = end;
        Some(end)
    })
}

fn scaled([a1, a2, a3]: PerDof<f64>, [b1, b2, b3]: PerDof<f64>, unit: PerDof<f64>) -> PerDof<f64> {
    let [u1, u2, u3] = unit;
    [(b1 - a1) / u1, (b2 - a2) / u2, (b3 - a3) / u3]
}
