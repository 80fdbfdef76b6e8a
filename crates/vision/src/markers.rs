//! Regions to markers: which region is band A, which is band B.

use std::fmt;

use crate::Region;
use crate::regions::real;

/// Areas that differ by more than this factor are not the two bands of one instrument.
pub const AREA_RATIO: f64 = 16.0;

/// Why no pair of regions is taken for the markers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// Nothing has the markers' colour.
    NoRegion,
    /// Only one region has the markers' colour.
    OneRegion,
    /// No two regions of comparable size lie where the markers are predicted.
    NoPair {
        /// How far from its prediction a marker may be (px).
        gate: f64,
    },
    /// The model of the instrument has no image of the bands where the loop believes it to be.
    Unseen,
    /// Too much of it is outside the image.
    Outside {
        /// Share of its area.
        share: f64,
    },
    /// Too little of what should be it has its colour.
    Hidden {
        /// Share that has.
        share: f64,
    },
    /// The colour goes on around it.
    Larger {
        /// Share of a ring around it that has its colour.
        share: f64,
    },
    /// The colour does not end where its outline does.
    Shape {
        /// Share of its outline where it does.
        share: f64,
    },
    /// What could be it could as well be the other one.
    Either,
    /// The two are not where they may be.
    Elsewhere {
        /// Mahalanobis distance from the expectation.
        distance: f64,
    },
}

impl fmt::Display for Rejection {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoRegion => formatter.write_str("no region"),
            Self::OneRegion => formatter.write_str("one region"),
            Self::NoPair { gate } => {
                write!(formatter, "no pair within {gate} px of the prediction")
            }
            Self::Unseen => formatter.write_str("cannot be seen where it is expected"),
            Self::Outside { share } => {
                write!(formatter, "{:.0} % outside the image", 100.0 * share)
            }
            Self::Hidden { share } => {
                write!(formatter, "only {:.0} % has its colour", 100.0 * share)
            }
            Self::Larger { share } => {
                write!(
                    formatter,
                    "its colour goes on around it over {:.0} %",
                    100.0 * share
                )
            }
            Self::Shape { share } => {
                write!(
                    formatter,
                    "only {:.0} % of its outline is there",
                    100.0 * share
                )
            }
            Self::Either => formatter.write_str("what could be it could be the other one"),
            Self::Elsewhere { distance } => {
                write!(
                    formatter,
                    "{distance:.1} deviations from where it is expected"
                )
            }
        }
    }
}

/// The markers among `regions` where they are predicted: their centroids `[u_A, v_A, u_B, v_B]` (px).
///
/// Of all ordered pairs of regions, both within `gate` px of the position predicted for them and
/// neither more than [`AREA_RATIO`] times the other, the pair of the least cost
///
/// ```text
/// (d_A^2 + d_B^2) / gate^2 + (ln(a_A / a_B) / ln R)^2 + (ln(a / (a_A + a_B)) / ln R)^2
/// ```
///
/// with d the distance to the prediction (px), `a_A` and `a_B` the areas (px), a the largest sum of areas
/// among these pairs, R the [`AREA_RATIO`]. The second term keeps a speck near a prediction, or a
/// large green thing in reach, from standing in for one band beside the other; the third keeps two
/// specks from standing in for both. It errs when a band is lost and something of the same colour and
/// of similar size is nearer than `gate`.
///
/// # Errors
/// The [`Rejection`] that says why there is no such pair.
pub fn near_prediction(
    regions: &[Region],
    predicted: [f64; 4],
    gate: f64,
) -> Result<[f64; 4], Rejection> {
    enough(regions)?;
    let pairs = || admissible(regions, predicted, gate);
    let largest = pairs().map(|pair| pair.area).fold(0.0, f64::max);
    let cost = |pair: &Pair| pair.cost + in_ratios(largest / pair.area).powi(2);
    pairs()
        .min_by(|one, other| cost(one).total_cmp(&cost(other)))
        .map(|pair| pair.features)
        .ok_or(Rejection::NoPair { gate })
}

/// The first two of `regions` as markers, as in the article, which takes the two largest; A, the proximal band,
/// is the one nearer to where the instrument enters the picture, `entry_point` `[u, v]` (px).
///
/// It errs when anything else of the colour is larger than a band, and when the instrument bends
/// back on itself.
///
/// # Errors
/// The [`Rejection`] that says which is missing.
pub fn two_largest(regions: &[Region], entry_point: [f64; 2]) -> Result<[f64; 4], Rejection> {
    let (one, other) = enough(regions)?;
    let distance = |region: &Region| squared_distance(region.centroid(), entry_point);
    Ok(if distance(one) <= distance(other) {
        features(one, other)
    } else {
        features(other, one)
    })
}

fn enough(regions: &[Region]) -> Result<(&Region, &Region), Rejection> {
    match regions {
        [] => Err(Rejection::NoRegion),
        [_] => Err(Rejection::OneRegion),
        [one, other, ..] => Ok((one, other)),
    }
}

struct Pair {
    features: [f64; 4],
    area: f64,
    cost: f64,
}

fn admissible(
    regions: &[Region],
    [u_a, v_a, u_b, v_b]: [f64; 4],
    gate: f64,
) -> impl Iterator<Item = Pair> {
    let away = move |region: &Region, predicted| {
        squared_distance(region.centroid(), predicted) / (gate * gate)
    };
    let ordered = regions.iter().enumerate().flat_map(move |(i, a)| {
        let others = regions.iter().enumerate().filter(move |(j, _)| *j != i);
        others.map(move |(_, b)| (a, b))
    });
    ordered.filter_map(move |(a, b)| {
        let (away_a, away_b) = (away(a, [u_a, v_a]), away(b, [u_b, v_b]));
        let (area_a, area_b) = (real(a.area), real(b.area));
        let ratio = in_ratios(area_a / area_b);
        (away_a <= 1.0 && away_b <= 1.0 && ratio.abs() <= 1.0).then(|| Pair {
            features: features(a, b),
            area: area_a + area_b,
            cost: away_a + away_b + ratio.powi(2),
        })
    })
}

/// A ratio of areas on a logarithmic scale whose unit is [`AREA_RATIO`].
fn in_ratios(ratio: f64) -> f64 {
    ratio.ln() / AREA_RATIO.ln()
}

fn features(a: &Region, b: &Region) -> [f64; 4] {
    let ([u_a, v_a], [u_b, v_b]) = (a.centroid(), b.centroid());
    [u_a, v_a, u_b, v_b]
}

fn squared_distance([u, v]: [f64; 2], [other_u, other_v]: [f64; 2]) -> f64 {
    (u - other_u).powi(2) + (v - other_v).powi(2)
}
