//! What speaks for a band, and what it must show.

use crate::fit::{Fit, settle};
use crate::{Expectation, Rejection, RunMap};

/// Least share of a band's rims at which the colour ends.
const RIMS: f64 = 0.2;

/// Share of its colour that a band has to itself: two outlines on one band share theirs.
const APART: f64 = 0.8;

/// Share of a band's edges with which it needs no further look.
const ENOUGH: f64 = 0.75;
/// And of its area.
const WHOLE: f64 = 0.8;
/// And the squared Mahalanobis distance.
const UNSURPRISING: f64 = 8.0;

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

impl Evidence {
    /// Whether there is no need to look further.
    pub(crate) fn is_clear(&self) -> bool {
        self.edges >= ENOUGH && self.coverage >= WHOLE && self.surprise <= UNSURPRISING
    }

    /// The fewer edges, the nearer to where it is expected a band must be: 1 where it has enough.
    fn trust(&self) -> f64 {
        (self.edges / ENOUGH).min(1.0).powi(2)
    }
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

impl From<[f64; 7]> for Demands {
    /// In the order of the fields.
    fn from(values: [f64; 7]) -> Self {
        let [
            inside,
            coverage,
            spill,
            edges,
            edges_on_average,
            edges_alone,
            surprise,
        ] = values;
        Self {
            inside,
            coverage,
            spill,
            edges,
            edges_on_average,
            edges_alone,
            surprise,
        }
    }
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

/// What speaks for each band of a fit, and why it is refused.
pub fn weigh(
    laid: &Expectation,
    found: &Fit,
    map: &RunMap,
    demands: &Demands,
) -> ([Evidence; 2], [Option<Rejection>; 2]) {
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
    for (reason, rims) in reasons.iter_mut().zip(found.rims) {
        // Sides alone do not say where along them it is.
        if reason.is_none() && rims < RIMS {
            *reason = Some(Rejection::Shape { share: rims });
        }
    }
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
    (bands, reasons)
}

fn refusal(band: &Evidence, demands: &Demands) -> Option<Rejection> {
    if band.inside < demands.inside {
        Some(Rejection::Outside {
            share: 1.0 - band.inside,
        })
    } else if band.coverage < demands.coverage
        || band.own < f64::max(0.75 * demands.coverage, APART * band.coverage)
    {
        Some(Rejection::Hidden { share: band.own })
    } else if band.spill > demands.spill * band.coverage {
        Some(Rejection::Larger { share: band.spill })
    } else if band.edges < demands.edges {
        Some(Rejection::Shape { share: band.edges })
    } else if band.surprise.is_nan() || band.surprise > demands.surprise * band.trust() {
        Some(Rejection::Elsewhere {
            distance: band.surprise.sqrt(),
        })
    } else {
        None
    }
}
