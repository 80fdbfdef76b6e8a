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

/// Standard deviations of camera and bands from where they are configured, where the geometry is relied on less: about the range
/// of the drawn instruments of docs/instruments.md, decisions 0048 and 0053.
const NEAR_CONFIGURED: core::GeometryDeviation = core::GeometryDeviation {
    shift: 2e-3,
    turn: 0.02,
    band: 0.3e-3,
};

/// The same where it is relied on least: they also stand for a section that bends unevenly.
const FAR_FROM_CONFIGURED: core::GeometryDeviation = core::GeometryDeviation {
    shift: 4e-3,
    turn: 0.04,
    band: 0.6e-3,
};

/// States (3,) [m, rad, rad] that together cover the workspace, each with the standard deviations `std` (3,).
#[derive(Debug, Clone)]
pub struct Workspace {
    /// The states.
    pub states: Vec<[f64; 3]>,
    /// The standard deviations.
    pub std: [f64; 3],
}

/// What the loop predicts for an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// State (3,) [m, rad, rad].
    pub state: [f64; 3],
    /// Its standard deviations (3,).
    pub std: [f64; 3],
    /// Unevenness of the section, shift (2,) of the image in px: `FeatureModel::with_geometry`.
    pub geometry: [f64; 3],
}

/// Predicts the marker bands of an image by the core's feature model, for [`tautscope_vision::Detector::recognise`].
#[derive(Debug, Clone, Copy)]
pub struct ModelPredictor<'a> {
    model: core::FeatureModel,
    model_deviation: f64,
    workspace: &'a Workspace,
    geometry: core::GeometryDeviation,
    /// State and standard deviations; None: anywhere in the workspace.
    prior: Option<([f64; 3], [f64; 3])>,
}

impl<'a> ModelPredictor<'a> {
    /// From what is predicted for an image; None if the state may be anywhere in the workspace. `model_deviation` is the standard deviation of a band from where the model has it (px).
    pub const fn new(
        model: &core::FeatureModel,
        model_deviation: f64,
        workspace: &'a Workspace,
        prior: Option<Prior>,
    ) -> Self {
        let (model, prior) = match prior {
            Some(known) => (
                model.with_geometry(known.geometry),
                Some((known.state, known.std)),
            ),
            None => (*model, None),
        };
        Self {
            model,
            model_deviation,
            workspace,
            geometry: core::GeometryDeviation::EXACT,
            prior,
        }
    }

    fn expect(&self, observed: [f64; 4], std: [f64; 4]) -> Option<core::Expected> {
        let (states, deviation) = match &self.prior {
            Some((state, std)) => (std::slice::from_ref(state), *std),
            None => (self.workspace.states.as_slice(), self.workspace.std),
        };
        let priors = core::StatePriors {
            states,
            deviation,
            model_deviation: self.model_deviation,
            geometry: self.geometry,
        };
        self.model.expect(&priors, observed, std)
    }
}

impl BandPredictor for ModelPredictor<'_> {
    fn predict(&self, observed: [f64; 4], std: [f64; 4]) -> Option<BandPrediction> {
        let expected = self.expect(observed, std)?;
        Some(BandPrediction {
            features: expected.features,
            covariance: expected.covariance,
            outlines: expected.bands.each_ref().map(outline),
        })
    }

    fn section(&self, observed: [f64; 4], std: [f64; 4]) -> [Option<SectionDisc>; SECTION_DISCS] {
        self.expect(observed, std)
            .map_or([None; SECTION_DISCS], |expected| {
                expected.model.section(expected.state).map(|disc| {
                    disc.map(|disc| SectionDisc {
                        centre: disc.centre,
                        radius: disc.radius,
                        is_nearer: disc.is_nearer,
                    })
                })
            })
    }

    fn is_located(&self) -> bool {
        self.prior.is_some()
    }

    fn near(&self, observed: [f64; 4]) -> Option<Self> {
        let state = self.expect(observed, [2.0; 4])?.state;
        Some(Self {
            prior: Some((state, self.workspace.std.map(|std| std / NEAR))),
            ..*self
        })
    }

    fn relaxed(&self) -> Option<Self> {
        let geometry = match self.geometry {
            core::GeometryDeviation::EXACT => NEAR_CONFIGURED,
            NEAR_CONFIGURED => FAR_FROM_CONFIGURED,
            _ => return None,
        };
        Some(Self { geometry, ..*self })
    }

    fn anywhere(&self) -> Option<Self> {
        Some(Self {
            prior: None,
            ..*self
        })
    }
}
