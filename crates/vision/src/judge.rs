//! Which of what has the markers' colour is a band: by place, size, outline, and both together.

use crate::evidence::{Demands, Evidence};
use crate::fit::{COARSE, FINE, Fit, fit, settle};
use crate::pairing::{Pair, TRIALS, likely, shift};
use crate::verdict::{NOWHERE, Verdict};
use crate::{Expect, Expectation, Region, Rejection, RunMap};

/// Outlines are laid again at most so often, and until they stay within so much (px).
const LAYS: usize = 6;
const STILL: f64 = 0.1;
/// A band is moved at most so often to where the image would cut it as it did.
const SHIFTS: usize = 10;
/// Two pairs whose outlines come to lie nearer than this to each other are one (px).
const SAME: f64 = 0.7;
/// A lone band must be nearer to its place than to the other's by this squared Mahalanobis distance.
const AMBIGUOUS: f64 = 9.0;

/// Recognises the bands among `regions` and `map`.
pub fn judge(regions: &[Region], map: &RunMap, expect: &impl Expect, demands: &Demands) -> Verdict {
    let Some(blind) = expect.expect(NOWHERE, [f64::INFINITY; 4]) else {
        return Verdict::nothing(Rejection::Unseen);
    };
    if regions.is_empty() {
        return Verdict::nothing(Rejection::NoRegion);
    }
    let mut best: Option<(f64, Verdict)> = None;
    let mut tried: [[f64; 4]; 2 * TRIALS] = [NOWHERE; 2 * TRIALS];
    let pairs = likely(regions, &blind);
    let starts = pairs.into_iter().flatten().flat_map(|pair| {
        let seen = places(pair, &blind, regions);
        [Some(seen), beyond(seen, &blind, map)]
    });
    for (index, seen) in starts.flatten().enumerate() {
        let Some((_, first)) = lay(seen, [4.0; 4], [true; 2], COARSE, map, expect) else {
            continue;
        };
        // Many pairs lead to one place.
        let again =
            |before: &[f64; 4]| (0..4).all(|i| (before[i] - first.features[i]).abs() < SAME);
        if tried.iter().any(again) {
            continue;
        }
        tried[index] = first.features;
        let Some(verdict) = refined(first, map, expect, demands) else {
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
        return Verdict::nothing(Rejection::NoRegion);
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
    let mut here = NOWHERE;
    [here[2 - 2 * band], here[3 - 2 * band]] = [u, v];
    let Evidence {
        edges, coverage, ..
    } = verdict.bands[band];
    if edges < demands.edges_alone || coverage < 0.75 * demands.edges_alone {
        verdict.reasons[band] = Some(Rejection::Shape { share: edges });
        verdict.conceal();
        return verdict;
    }
    let as_good = [here, places(pair, blind, regions)].iter().any(|seen| {
        judge_at(*seen, [4.0; 4], map, expect, demands).is_some_and(|other| {
            other.reasons[1 - band].is_none()
                && other.bands[1 - band].surprise < verdict.bands[band].surprise + AMBIGUOUS
        })
    });
    if as_good {
        verdict.reasons[band] = Some(Rejection::Either);
        verdict.conceal();
    }
    verdict
}

/// Where the bands are if these regions are they.
fn places(pair: Pair, blind: &Expectation, regions: &[Region]) -> [f64; 4] {
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
    seen
}

/// Where the bands are if these are the centroids of what the border of the image leaves of them; None if it cuts neither.
fn beyond(mut seen: [f64; 4], blind: &Expectation, map: &RunMap) -> Option<[f64; 4]> {
    let mut cut = false;
    for (outline, place) in blind.bands.iter().zip(seen.chunks_exact_mut(2)) {
        let part = [place[0], place[1]];
        let mut outline = settle(outline, part);
        for _ in 0..SHIFTS {
            let Some([u, v]) = outline.centroid_within(map) else {
                break;
            };
            let [du, dv] = [part[0] - u, part[1] - v];
            if du.hypot(dv) < SAME {
                break;
            }
            cut = true;
            outline = outline.moved([du, dv]);
        }
        place.copy_from_slice(&outline.centroid);
    }
    cut.then_some(seen)
}

/// The verdict on outlines laid from there on, features (4,) in px with standard deviations (4,) in px.
pub fn judge_at(
    seen: [f64; 4],
    deviation: [f64; 4],
    map: &RunMap,
    expect: &impl Expect,
    demands: &Demands,
) -> Option<Verdict> {
    let (_, first) = lay(seen, deviation, [true; 2], COARSE, map, expect)?;
    refined(first, map, expect, demands)
}

/// The verdict on outlines that lie where they belong, but for a little.
fn refined(
    mut found: Fit,
    map: &RunMap,
    expect: &impl Expect,
    demands: &Demands,
) -> Option<Verdict> {
    let mut laid = None;
    // The better the place is known, the better the outlines.
    for _ in 0..LAYS {
        let before = found.features;
        let again = lay(before, sureness(&found), [true; 2], FINE, map, expect);
        let Some(again) = again else { break };
        found = again.1;
        laid = Some(again.0);
        let moved = before.iter().zip(found.features);
        if moved.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < STILL {
            break;
        }
    }
    let verdict = Verdict::of(&laid?, &found, map, demands);
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
            let mut last = Verdict::of(&laid, &found, map, demands);
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
