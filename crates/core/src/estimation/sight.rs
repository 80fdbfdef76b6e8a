//! What an image says of each marker, made ready to be weighed.

use crate::article::state::found;
use crate::dof::all_finite;
use crate::math::linear::square;

/// A marker's place in px, and the rows that make its error white: with W them and C the covariance
/// of the error, W C W' = I.
#[derive(Clone, Copy)]
pub struct Sight {
    pub place: [f64; 2],
    pub whitener: [[f64; 2]; 2],
}

/// Markers A and B; None for one that was not found or is not finite.
pub type Sights = [Option<Sight>; 2];

/// Both markers, from features (4,) in px and their covariance (4, 4) in px^2, to which
/// `model_deviation` in px is added; without a covariance each has `marker_deviation` in px.
pub fn sights(
    measured: [f64; 4],
    covariance: Option<&[[f64; 4]; 4]>,
    marker_deviation: f64,
    model_deviation: f64,
) -> Sights {
    let own = square(marker_deviation);
    let (of_a, of_b) = match covariance {
        Some(&[[a, b, _, _], [_, c, _, _], [_, _, d, e], [_, _, _, f]]) => ([a, b, c], [d, e, f]),
        None => ([own, 0.0, own], [own, 0.0, own]),
    };
    let [ua, va, ub, vb] = measured;
    let [found_a, found_b] = found(measured);
    let model = square(model_deviation);
    let seen = |found: bool, place, variances| {
        let sight = Sight::new(place, variances, model);
        sight.filter(|_| found)
    };
    [seen(found_a, [ua, va], of_a), seen(found_b, [ub, vb], of_b)]
}

/// The sights of the markers that are named.
pub fn only([a, b]: [bool; 2], [sight_a, sight_b]: Sights) -> Sights {
    [sight_a.filter(|_| a), sight_b.filter(|_| b)]
}

/// The markers that are in both.
pub fn both([a, b]: [bool; 2], [c, d]: [bool; 2]) -> [bool; 2] {
    [a && c, b && d]
}

impl Sight {
    /// From var(u), cov(u, v), var(v), and what is added to both variances, in px^2.
    fn new(place: [f64; 2], [uu, uv, vv]: [f64; 3], added: f64) -> Option<Self> {
        // The inverse of Cholesky's factor.
        let first = 1.0 / libm::sqrt(uu + added);
        let mixed = uv * first;
        let second = 1.0 / libm::sqrt(vv + added - mixed * mixed);
        let whitener = [[first, 0.0], [-second * mixed * first, second]];
        let finite = all_finite(place) && first.is_finite() && second.is_finite();
        finite.then_some(Self { place, whitener })
    }
}
