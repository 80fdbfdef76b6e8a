//! Prediction of the marker bands in an image: the vision's [`BandPredictor`] by the model of the core.
//!
//! Core and vision do not know each other; every interface that runs both uses this crate.
#![forbid(unsafe_code)]

use tautscope_core as core;
use tautscope_vision::{BandPrediction, BandPredictor, Outline, SECTION_DISCS, SectionDisc};

/// Outlines of both bands in a posture (3,) [m, rad, rad]; None if the camera does not see them.
pub fn outlines(model: &core::FeatureModel, posture: [f64; 3]) -> Option<[Outline; 2]> {
    Some(model.bands(posture)?.each_ref().map(outline))
}

fn outline(band: &core::BandImage) -> Outline {
    Outline {
        corners: band.outline,
        centroid: band.centroid,
        area: band.area,
    }
}

/// Standard deviations of a posture that was found in an image: those of the workspace over this.
const NEAR: f64 = 8.0;

/// Predicts the marker bands of an image by the core's feature model, for [`tautscope_vision::Detector::recognise`].
#[derive(Debug, Clone, Copy)]
pub struct ModelPredictor<'a> {
    model: &'a core::FeatureModel,
    beliefs: core::Beliefs<'a>,
    /// The only state, where it was found in the image.
    state: Option<[f64; 3]>,
}

impl<'a> ModelPredictor<'a> {
    /// From the state prediction of an image.
    pub const fn new(model: &'a core::FeatureModel, beliefs: core::Beliefs<'a>) -> Self {
        Self {
            model,
            beliefs,
            state: None,
        }
    }

    fn beliefs(&self) -> core::Beliefs<'_> {
        match &self.state {
            Some(state) => core::Beliefs {
                states: std::slice::from_ref(state),
                ..self.beliefs
            },
            None => self.beliefs,
        }
    }
}

impl BandPredictor for ModelPredictor<'_> {
    fn predict(&self, observed: [f64; 4], std: [f64; 4]) -> Option<BandPrediction> {
        let expected = self.model.expect(&self.beliefs(), observed, std)?;
        Some(BandPrediction {
            features: expected.features,
            covariance: expected.covariance,
            outlines: expected.bands.each_ref().map(outline),
        })
    }

    fn section(&self, observed: [f64; 4], std: [f64; 4]) -> [Option<SectionDisc>; SECTION_DISCS] {
        self.model.expect(&self.beliefs(), observed, std).map_or(
            [None; SECTION_DISCS],
            |expected| {
                self.model.section(expected.state).map(|disc| {
                    disc.map(|disc| SectionDisc {
                        centre: disc.centre,
                        radius: disc.radius,
                        is_nearer: disc.is_nearer,
                    })
                })
            },
        )
    }

    fn is_located(&self) -> bool {
        self.beliefs().states.len() <= 1
    }

    fn near(&self, observed: [f64; 4]) -> Option<Self> {
        let state = self.model.expect(&self.beliefs, observed, [2.0; 4])?.state;
        Some(Self {
            state: Some(state),
            beliefs: core::Beliefs {
                deviation: self.beliefs.deviation.map(|std| std / NEAR),
                ..self.beliefs
            },
            ..*self
        })
    }
}
