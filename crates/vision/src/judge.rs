//! Which of what has the markers' colour is a band: by place, size, outline, and both together.

use crate::fit::{COARSE, FINE, Fit, fit, settle};
use crate::linear::{inverse, quadratic};
use crate::regions::real;
use crate::{Expect, Expectation, Region, Rejection, RunMap};

/// How the two bands were recognised, or why not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Centroids `[u_A, v_A, u_B, v_B]` (px); NaN for a band that is not found.
    pub features: [f64; 4],
    /// Their covariance (4, 4) (px^2); NaN likewise.
    pub covariance: [[f64; 4]; 4],
    /// What each band looks like; none of it counts for a band that nothing was compared with.
    pub bands: [Evidence; 2],
    /// Why a band is not found.
    pub reasons: [Option<Rejection>; 2],
    /// Which discriminant it rests on: 0 is the trained one, others are its alternatives.
    pub discriminant: usize,
}

/// What speaks for a band.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Share of its outline's area that is in the image.
    pub inside: f64,
    /// Share of that which has the markers' colour.
    pub coverage: f64,
    /// Share of it that has the markers' colour and is not in the other band's outline.
    pub own: f64,
    /// Share of a ring around it that has the markers' colour.
    pub spill: f64,
    /// Share of its outline at which the colour ends.
    pub edges: f64,
    /// How much its outline had to grow (px).
    pub bloom: f64,
    /// Squared Mahalanobis distance of both bands from where they were expected.
    pub surprise: f64,
    /// Centroid of the outline, u, v (px).
    pub centroid: [f64; 2],
}

/// What a band must show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demands {
    /// Least [`Evidence::inside`].
    pub inside: f64,
    /// Least [`Evidence::coverage`].
    pub coverage: f64,
    /// Largest [`Evidence::spill`] over [`Evidence::coverage`].
    pub spill: f64,
    /// Least [`Evidence::edges`].
    pub edges: f64,
    /// Least mean of the edges of both bands.
    pub edges_on_average: f64,
    /// Least edges, and three quarters of it the least coverage, of a band that is found alone.
    pub edges_alone: f64,
    /// Largest squared Mahalanobis distance of both from where they are expected.
    pub surprise: f64,
}

impl Demands {
    /// Where nothing is known of the place, only what is all but whole is a band.
    #[must_use]
    pub fn without_a_place(&self) -> Self {
        Self {
            inside: self.inside.max(0.9),
            coverage: self.coverage.max(0.75),
            edges: self.edges.max(0.75),
            edges_on_average: self.edges_on_average.max(0.85),
            edges_alone: f64::INFINITY,
            ..*self
        }
    }
}

const NOWHERE: [f64; 4] = [f64::NAN; 4];
/// Pairs of regions that are tried, the likeliest first.
const TRIALS: usize = 6;
/// Outlines are laid again at most so often, and until they stay within so much (px).
const LAYS: usize = 4;
const STILL: f64 = 0.2;
/// A lone band must be nearer to its place than to the other's by this squared Mahalanobis distance.
const AMBIGUOUS: f64 = 9.0;
/// Share of edges of both bands with which a verdict needs no other.
const ENOUGH: f64 = 0.75;
/// And the squared Mahalanobis distance.
const UNSURPRISING: f64 = 8.0;
/// What a unit of that distance takes from a score that edges make.
const DOUBT: f64 = 0.02;

/// Recognises the bands among `regions` and `map`.
pub fn judge(regions: &[Region], map: &RunMap, expect: &impl Expect, demands: &Demands) -> Verdict {
    let Some(blind) = expect.expect(NOWHERE, [f64::INFINITY; 4]) else {
        return nothing(Rejection::Unseen);
    };
    if regions.is_empty() {
        return nothing(Rejection::NoRegion);
    }
    let mut best: Option<(f64, Verdict)> = None;
    for pair in likely(regions, &blind).into_iter().flatten() {
        let Some(verdict) = attempt(pair, &blind, regions, map, expect, demands) else {
            continue;
        };
        let score = verdict.score();
        if best.is_none_or(|(most, _)| score > most) {
            best = Some((score, verdict));
        }
        if verdict.is_clear() {
            break;
        }
    }
    let Some((_, verdict)) = best else {
        return nothing(Rejection::NoRegion);
    };
    match verdict.reasons {
        [None, Some(_)] => alone(verdict, 0, &blind, regions, map, expect, demands),
        [Some(_), None] => alone(verdict, 1, &blind, regions, map, expect, demands),
        _ => verdict,
    }
}

/// A band found alone, unless the same would do as well for the other band.
fn alone(
    mut verdict: Verdict,
    band: usize,
    blind: &Expectation,
    regions: &[Region],
    map: &RunMap,
    expect: &impl Expect,
    demands: &Demands,
) -> Verdict {
    let [u, v] = verdict.bands[band].centroid;
    let away = |region: &Region| {
        let [ru, rv] = region.centroid();
        (ru - u).hypot(rv - v)
    };
    let order = (0..regions.len()).min_by(|a, b| away(&regions[*a]).total_cmp(&away(&regions[*b])));
    let mut pair = [None; 2];
    pair[1 - band] = order;
    let other = attempt(pair, blind, regions, map, expect, demands);
    let Evidence {
        edges, coverage, ..
    } = verdict.bands[band];
    if edges < demands.edges_alone || coverage < 0.75 * demands.edges_alone {
        verdict.reasons[band] = Some(Rejection::Shape { share: edges });
        verdict.conceal();
        return verdict;
    }
    let as_good = other.is_some_and(|other| {
        other.reasons[1 - band].is_none()
            && other.bands[1 - band].surprise < verdict.bands[band].surprise + AMBIGUOUS
    });
    if as_good {
        verdict.reasons[band] = Some(Rejection::Either);
        verdict.conceal();
    }
    verdict
}

impl Verdict {
    /// Each band found counts one and its edges; where they are surprising counts against it.
    pub(crate) fn score(&self) -> f64 {
        let bands = self.bands.iter().zip(&self.reasons);
        let shown = |(band, reason): (&Evidence, &Option<Rejection>)| match reason {
            None => 1.0 + band.edges - DOUBT * band.surprise,
            Some(_) => 0.1 * band.edges,
        };
        bands.map(shown).sum()
    }
}

/// A region for A and one for B; none: not among the regions; one for both: they run into each other.
type Pair = [Option<usize>; 2];

/// The likeliest pairs, the likeliest first: squared Mahalanobis distance of each pair's centroids, where a
/// centroid may be off by a third of the band's size, and squared logarithm of the ratios of areas. A band without a region
/// costs as much as one four deviations off.
fn likely(regions: &[Region], expected: &Expectation) -> [Option<Pair>; TRIALS] {
    let mut kept: [Option<(f64, Pair)>; TRIALS] = [None; TRIALS];
    let slack = expected
        .bands
        .each_ref()
        .map(|band| (0.35 * band.radius()).powi(2));
    let mut covariance = expected.covariance;
    for (index, row) in covariance.iter_mut().enumerate() {
        row[index] += slack[index / 2];
    }
    let choices = || (0..regions.len()).map(Some).chain([None]);
    let both = inverse(covariance).unwrap_or([[0.0; 4]; 4]);
    let single = [0, 2].map(|at| {
        let part = [0, 1].map(|i| [0, 1].map(|j| covariance[at + i][at + j]));
        inverse(part).unwrap_or([[0.0; 2]; 2])
    });
    let middle = [0, 1].map(|i| {
        [0, 1].map(|j| {
            let across = covariance[i][j + 2] + covariance[i + 2][j];
            (covariance[i][j] + covariance[i + 2][j + 2] + across) / 4.0
        })
    });
    let middle = inverse(middle).unwrap_or([[0.0; 2]; 2]);
    let away = |index: usize, band: usize| {
        let [u, v] = regions[index].centroid();
        [
            u - expected.features[2 * band],
            v - expected.features[2 * band + 1],
        ]
    };
    let size = |index: usize, band: usize| {
        (real(regions[index].area) / expected.bands[band].area)
            .ln()
            .powi(2)
    };
    for a in choices() {
        for b in choices() {
            let cost = match (a, b) {
                (Some(a), Some(b)) if a != b => {
                    let ([ua, va], [ub, vb]) = (away(a, 0), away(b, 1));
                    quadratic(&both, [ua, va, ub, vb]) + size(a, 0) + size(b, 1)
                }
                (Some(a), None) => 16.0 + quadratic(&single[0], away(a, 0)) + size(a, 0),
                (None, Some(b)) => 16.0 + quadratic(&single[1], away(b, 1)) + size(b, 1),
                (Some(one), Some(_)) => {
                    let both = expected.bands[0].area + expected.bands[1].area;
                    let shift = shift(regions[one].centroid(), expected);
                    quadratic(&middle, shift) + (real(regions[one].area) / both).ln().powi(2)
                }
                (None, None) => 24.0,
            };
            let place = kept
                .iter()
                .position(|one| one.is_none_or(|(less, _)| cost < less));
            if let Some(place) = place {
                kept[place..].rotate_right(1);
                kept[place] = Some((cost, [a, b]));
            }
        }
    }
    kept.map(|one| one.map(|(_, pair)| pair))
}

/// From the middle of the two expected bands to a region over both.
fn shift([u, v]: [f64; 2], expected: &Expectation) -> [f64; 2] {
    let [ua, va, ub, vb] = expected.features;
    [u - f64::midpoint(ua, ub), v - f64::midpoint(va, vb)]
}

fn attempt(
    pair: Pair,
    blind: &Expectation,
    regions: &[Region],
    map: &RunMap,
    expect: &impl Expect,
    demands: &Demands,
) -> Option<Verdict> {
    let mut seen = NOWHERE;
    for (band, region) in pair.into_iter().enumerate() {
        if let Some(region) = region.and_then(|index| regions.get(index)) {
            [seen[2 * band], seen[2 * band + 1]] = region.centroid();
        }
    }
    if let [Some(one), Some(other)] = pair
        && one == other
    {
        let [u, v] = shift(regions[one].centroid(), blind);
        let [ua, va, ub, vb] = blind.features;
        seen = [ua + u, va + v, ub + u, vb + v];
    }
    let (mut laid, mut found) = lay(seen, [4.0; 4], [true; 2], COARSE, map, expect)?;
    // The better the place is known, the better the outlines.
    for _ in 0..LAYS {
        let before = found.features;
        let again = lay(before, sureness(&found), [true; 2], FINE, map, expect);
        let Some(again) = again else { break };
        (laid, found) = again;
        let moved = before.iter().zip(found.features);
        if moved.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < STILL {
            break;
        }
    }
    let verdict = weigh(&laid, &found, map, demands);
    match verdict.reasons {
        [None, None] | [Some(_), Some(_)] => Some(verdict),
        reasons => {
            // Alone: the one that is not there must not say where the other is.
            let alone = [reasons[0].is_none(), reasons[1].is_none()];
            let mut seen = found.features;
            for band in (0..2).filter(|band| !alone[*band]) {
                seen[2 * band..2 * band + 2].fill(f64::NAN);
            }
            let (laid, found) = lay(seen, sureness(&found), alone, FINE, map, expect)?;
            let mut last = weigh(&laid, &found, map, demands);
            for band in (0..2).filter(|band| !alone[*band]) {
                last.reasons[band] = reasons[band].or(Some(Rejection::NoRegion));
                last.bands[band] = verdict.bands[band];
            }
            last.conceal();
            Some(last)
        }
    }
}

/// Standard deviations of a fit's features, not quite as it believes: its outlines were not yet right.
fn sureness(found: &Fit) -> [f64; 4] {
    [0, 1, 2, 3].map(|index: usize| 0.3 + 2.0 * found.covariance[index][index].max(0.0).sqrt())
}

fn lay(
    seen: [f64; 4],
    deviation: [f64; 4],
    bands: [bool; 2],
    rounds: [f64; 3],
    map: &RunMap,
    expect: &impl Expect,
) -> Option<(Expectation, Fit)> {
    let laid = expect.expect(seen, deviation)?;
    let [a, b] = &laid.bands;
    let mut start = [a.centroid[0], a.centroid[1], b.centroid[0], b.centroid[1]];
    for (start, seen) in start.iter_mut().zip(seen) {
        if seen.is_finite() {
            *start = seen;
        }
    }
    let found = fit(&laid, start, bands, rounds, map)?;
    Some((laid, found))
}

fn weigh(laid: &Expectation, found: &Fit, map: &RunMap, demands: &Demands) -> Verdict {
    let [ua, va, ub, vb] = found.features;
    let places = [[ua, va], [ub, vb]];
    let outlines = [0, 1].map(|band| {
        settle(&laid.bands[band], places[band]).grown(f64::midpoint(
            found.bloom[band].rims,
            found.bloom[band].sides,
        ))
    });
    let bands = [0, 1].map(|band| {
        let (own, other) = (&outlines[band], &outlines[1 - band]);
        let whole = own.count(map, other);
        let radius = own.radius();
        let inner = own.grown(f64::max(1.5, 0.1 * radius)).count(map, other);
        let outer = own.grown(f64::max(4.0, 0.4 * radius)).count(map, other);
        let ring = f64::max(outer.pixels - inner.pixels, 1.0);
        let marker = outer.marker - inner.marker - (outer.shared - inner.shared);
        Evidence {
            inside: whole.pixels / own.area,
            coverage: whole.marker / f64::max(whole.pixels, 1.0),
            own: (whole.marker - whole.shared) / f64::max(whole.pixels, 1.0),
            spill: marker / ring,
            edges: found.edges[band],
            bloom: found.bloom[band].rims,
            surprise: found.surprise,
            centroid: places[band],
        }
    });
    let mut reasons = bands.map(|band| refusal(&band, demands));
    // The weaker of two weak ones falls, and with it the other.
    let weaker = usize::from(bands[1].edges < bands[0].edges);
    let average = |band: usize| match reasons[1 - band] {
        None => f64::midpoint(bands[0].edges, bands[1].edges),
        Some(_) => f64::INFINITY,
    };
    for band in [weaker, 1 - weaker] {
        if reasons[band].is_none() && average(band) < demands.edges_on_average {
            reasons[band] = Some(Rejection::Shape {
                share: bands[band].edges,
            });
            break;
        }
    }
    let mut verdict = Verdict {
        features: found.features,
        covariance: found.covariance,
        bands,
        reasons,
        discriminant: 0,
    };
    verdict.conceal();
    verdict
}

fn refusal(band: &Evidence, demands: &Demands) -> Option<Rejection> {
    if band.inside < demands.inside {
        Some(Rejection::Outside {
            share: 1.0 - band.inside,
        })
    } else if band.coverage < demands.coverage || band.own < 0.75 * demands.coverage {
        Some(Rejection::Hidden { share: band.own })
    } else if band.spill > demands.spill * band.coverage {
        Some(Rejection::Larger { share: band.spill })
    } else if band.edges < demands.edges {
        Some(Rejection::Shape { share: band.edges })
    } else if band.surprise.is_nan() || band.surprise > demands.surprise {
        Some(Rejection::Elsewhere {
            distance: band.surprise.sqrt(),
        })
    } else {
        None
    }
}

impl Verdict {
    /// Whether there is no need to look further.
    pub(crate) fn is_clear(&self) -> bool {
        let mut bands = self.bands.iter().zip(&self.reasons);
        bands.all(|(band, reason)| {
            reason.is_none() && band.edges >= ENOUGH && band.surprise <= UNSURPRISING
        })
    }

    /// What is not found has no features.
    fn conceal(&mut self) {
        for band in (0..2).filter(|band| self.reasons[*band].is_some()) {
            for index in [2 * band, 2 * band + 1] {
                self.features[index] = f64::NAN;
                self.covariance[index] = NOWHERE;
                for row in &mut self.covariance {
                    row[index] = f64::NAN;
                }
            }
        }
    }
}

fn nothing(reason: Rejection) -> Verdict {
    Verdict {
        features: NOWHERE,
        covariance: [NOWHERE; 4],
        bands: [Evidence {
            centroid: [f64::NAN; 2],
            ..Evidence::default()
        }; 2],
        reasons: [Some(reason); 2],
        discriminant: 0,
    }
}
