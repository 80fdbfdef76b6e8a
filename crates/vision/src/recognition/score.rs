//! Scores of a fitted outline, and the thresholds they must reach.

use super::fit::Fit;
use super::rejection::Rejection;
use crate::math::points;
use crate::scan::RunMap;
use crate::settings::Settings;

/// Scores of a band.
///
/// Of a band without edges, which is recognised by its intensity: `edges` is the share of the intensity's variance that is explained,
/// `growth` the standard deviation of the blur (px), `pixels` the area of the outline (px), and all other shares are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BandScore {
    /// Share of the outline's area inside the image.
    pub inside: f64,
    /// Share of that part that has the markers' colour.
    pub coverage: f64,
    /// Share of that part that has the markers' colour and is not inside the other band's outline.
    pub exclusive: f64,
    /// Share of a ring around the outline that has the markers' colour.
    pub spill: f64,
    /// Share of the outline at which an edge was found.
    pub edges: f64,
    /// Growth of the outline along the band's axis (px).
    pub growth: f64,
    /// Squared Mahalanobis distance of both bands from their predicted positions.
    pub mahalanobis_squared: f64,
    /// Marker pixels inside the outline that are not inside the other band's outline (px).
    pub pixels: f64,
    /// Centroid of the outline, u, v (px).
    pub centroid: [f64; 2],
}

impl BandScore {
    /// Whether no other candidate needs to be tried.
    pub(super) fn is_clear(&self, settings: &Settings) -> bool {
        let clear = &settings.clear;
        self.edges >= clear.least_edges
            && self.coverage >= clear.least_coverage
            && self.mahalanobis_squared <= clear.largest_surprise
    }

    /// The first threshold that the band fails, with edges at this share of its rims.
    fn rejection(&self, rims: f64, settings: &Settings) -> Option<Rejection> {
        // A band with few edges must be near its predicted position: the bound falls with the square of their share.
        let shortage = (self.edges / settings.clear.least_edges).min(1.0).powi(2);
        let least_exclusive = settings.least_exclusive * self.coverage;
        if self.inside < settings.least_inside {
            Some(Rejection::Outside(1.0 - self.inside))
        } else if self.coverage < settings.least_coverage || self.exclusive < least_exclusive {
            Some(Rejection::Hidden(self.exclusive))
        } else if self.spill > settings.largest_spill * self.coverage {
            Some(Rejection::Spill(self.spill))
        } else if self.edges < settings.least_edges {
            Some(Rejection::MissingEdges(self.edges))
        } else if self.mahalanobis_squared <= settings.largest_surprise * shortage {
            // The sides alone do not determine the position along them.
            (rims < settings.least_rims).then_some(Rejection::MissingEdges(rims))
        } else {
            Some(Rejection::Elsewhere(self.mahalanobis_squared.sqrt()))
        }
    }
}

/// Scores each band of a fit, and rejects those below the thresholds.
pub fn score(
    fit: &Fit,
    map: &RunMap,
    settings: &Settings,
) -> ([BandScore; 2], [Option<Rejection>; 2]) {
    let centroids = points(fit.features);
    let outlines = [0, 1].map(|band| {
        let (rims, sides) = (fit.growth[2 * band], fit.growth[2 * band + 1]);
        fit.outlines[band].grown(f64::midpoint(rims, sides))
    });
    let scores = [0, 1].map(|band| {
        let (own, other) = (&outlines[band], &outlines[1 - band]);
        let whole = own.count(map, other);
        let radius = own.radius();
        // The ring begins where the low-pass ends, and is wide enough to tell a band from a part of a larger region.
        let inner = own.grown(f64::max(1.5, 0.1 * radius)).count(map, other);
        let outer = own.grown(f64::max(4.0, 0.4 * radius)).count(map, other);
        let ring = f64::max(outer.pixels - inner.pixels, 1.0);
        let marker = outer.marker - inner.marker - (outer.shared - inner.shared);
        BandScore {
            inside: whole.pixels / own.area,
            coverage: whole.marker / f64::max(whole.pixels, 1.0),
            exclusive: (whole.marker - whole.shared) / f64::max(whole.pixels, 1.0),
            spill: marker / ring,
            edges: fit.edges[band],
            growth: fit.growth[2 * band],
            mahalanobis_squared: fit.mahalanobis_squared,
            pixels: whole.marker - whole.shared,
            centroid: centroids[band],
        }
    });
    let mut rejections = [0, 1].map(|band| scores[band].rejection(fit.rims[band], settings));
    // Where two bands are too weak on average the weaker one is rejected; the other then has to pass alone.
    let edges = scores.map(|score| score.edges);
    let weaker = usize::from(edges[1] < edges[0]);
    if rejections == [None; 2]
        && f64::midpoint(edges[0], edges[1]) < settings.least_edges_on_average
    {
        rejections[weaker] = Some(Rejection::MissingEdges(edges[weaker]));
    }
    (scores, rejections)
}
