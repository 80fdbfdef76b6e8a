//! What is said of the two bands, and how good it is.

use crate::evidence::{Demands, Evidence, weigh};
use crate::fit::Fit;
use crate::{Expectation, Rejection, RunMap};

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

/// Where no band is.
pub(crate) const NOWHERE: [f64; 4] = [f64::NAN; 4];
/// Variance that a band has more of for its missing edges.
const HIDDEN: f64 = 5.0;
/// What a unit of surprise, a squared Mahalanobis distance, takes from a score that edges make.
const DOUBT: f64 = 0.02;

impl Verdict {
    pub(crate) fn of(laid: &Expectation, found: &Fit, map: &RunMap, demands: &Demands) -> Self {
        let (bands, reasons) = weigh(laid, found, map, demands);
        let mut verdict = Self {
            features: found.features,
            covariance: doubted(&found.covariance, found.edges),
            bands,
            reasons,
            discriminant: 0,
        };
        verdict.conceal();
        verdict
    }

    /// Whether there is no need to look further.
    pub(crate) fn is_clear(&self) -> bool {
        let mut bands = self.bands.iter().zip(&self.reasons);
        bands.all(|(band, reason)| reason.is_none() && band.is_clear())
    }

    /// What is not found has no features.
    pub(crate) fn conceal(&mut self) {
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

    /// No band, for one reason.
    pub(crate) fn nothing(reason: Rejection) -> Self {
        Self {
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

    /// Each band found counts one and its edges; where they are surprising counts against it.
    ///
    /// So does a band of which too much is outside the image, if the rest is clear: else outlines that lie worse, but
    /// farther inside, would win.
    pub(crate) fn score(&self) -> f64 {
        let bands = self.bands.iter().zip(&self.reasons);
        let shown = |(band, reason): (&Evidence, &Option<Rejection>)| {
            let located = match reason {
                None => true,
                Some(Rejection::Outside { .. }) => band.is_clear(),
                Some(_) => false,
            };
            if located {
                1.0 + band.edges - DOUBT * band.surprise
            } else {
                0.1 * band.edges
            }
        };
        bands.map(shown).sum()
    }
}

/// What hides a part of an outline may pass for another part of it: the less of it is there, the less sure it is.
fn doubted(covariance: &[[f64; 4]; 4], edges: [f64; 2]) -> [[f64; 4]; 4] {
    let factors = edges.map(|share| (1.0 + HIDDEN * (1.0 - share)).sqrt());
    std::array::from_fn(|i| {
        std::array::from_fn(|j| covariance[i][j] * factors[i / 2] * factors[j / 2])
    })
}
