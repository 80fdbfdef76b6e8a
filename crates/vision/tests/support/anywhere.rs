//! A prediction of two discs that may be anywhere.

use tautscope_vision::{BandPrediction, BandPredictor};

use super::discs::Discs;

/// Two discs whose posture is not known; `near` gives them at the observed features.
#[derive(Clone, Copy, Debug)]
pub struct Anywhere {
    place: Discs,
    is_known: bool,
}

impl Anywhere {
    /// Discs that may be anywhere.
    pub fn new() -> Self {
        Self {
            place: Discs::at([30.0, 30.0, 30.0, 14.0]),
            is_known: false,
        }
    }

    /// Discs that are expected at `features` (px), but may be anywhere.
    pub fn expected_at(features: [f64; 4]) -> Self {
        Self {
            place: Discs::at(features),
            is_known: true,
        }
    }
}

impl BandPredictor for Anywhere {
    fn predict(&self, observed: [f64; 4], std: [f64; 4]) -> Option<BandPrediction> {
        let is_observed = std.iter().chain(&observed).all(|value| value.is_finite());
        if is_observed && !self.is_known {
            Discs::at(observed).predict(observed, std)
        } else {
            self.place.predict(observed, std)
        }
    }

    fn is_located(&self) -> bool {
        self.is_known
    }

    fn near(&self, observed: [f64; 4]) -> Option<Self> {
        Some(Self::expected_at(observed))
    }

    fn relaxed(&self) -> Option<Self> {
        Some(*self)
    }

    fn anywhere(&self) -> Option<Self> {
        Some(Self::new())
    }
}
