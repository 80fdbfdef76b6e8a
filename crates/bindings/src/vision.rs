//! Image to markers: `tautscope._core.MarkerDetector` and `label_regions`.

#![expect(
    clippy::needless_pass_by_value,
    reason = "PyO3 hands arguments over by value"
)]

use std::sync::{Arc, Mutex, PoisonError};

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tautscope_band_prediction::{ModelPredictor, Prior, Workspace, outlines};
use tautscope_core as core;
use tautscope_vision::{
    self as vision, ColorDiscriminant, Detector, Error, Frame, Labeller, MAX_SIDE, PixelFormat,
    Segmenter, Settings, Window,
};

use crate::arrays::table;
use crate::errors;
use crate::features::FeatureModel;
use crate::frame::ArrayFrame;
use crate::region::{Described, described};
use crate::settings::from_mapping;

/// The images of both bands in states (n, 3) that cover the workspace densely, which detectors of one model share.
#[pyclass(frozen, module = "tautscope._core")]
pub struct PostureTable(Arc<vision::PostureTable>);

#[pymethods]
impl PostureTable {
    #[new]
    fn new(model: &FeatureModel, states: Vec<[f64; 3]>) -> Self {
        let outlines = states.iter().filter_map(|state| outlines(&model.0, *state));
        Self(Arc::new(vision::PostureTable::new(outlines)))
    }
}

/// Finds the markers in frames; `tautscope.loop.vision.MarkerDetector` is its public interface.
#[pyclass(frozen, module = "tautscope._core")]
pub struct MarkerDetector {
    format: PixelFormat,
    model: core::FeatureModel,
    model_deviation: f64,
    workspace: Workspace,
    segmenter: Segmenter,
    detector: Mutex<Detector>,
}

#[pymethods]
impl MarkerDetector {
    /// `settings` is the mapping of `VisionConfig`; `states` (n, 3) with the standard deviations `std` (3,) cover the
    /// workspace coarsely.
    #[new]
    fn new(
        py: Python<'_>,
        model: &FeatureModel,
        pixel_format: &str,
        settings: Bound<'_, PyAny>,
        postures: &PostureTable,
        states: Vec<[f64; 3]>,
        std: [f64; 3],
    ) -> PyResult<Self> {
        let settings: Settings = from_mapping("vision", settings)?;
        let Settings {
            weights,
            threshold,
            smoothing,
            model_deviation,
            ..
        } = settings;
        let discriminant = ColorDiscriminant::new(weights, threshold).map_err(rejected(py))?;
        Ok(Self {
            format: PixelFormat::named(pixel_format).map_err(rejected(py))?,
            model: model.0,
            model_deviation,
            workspace: Workspace { states, std },
            segmenter: Segmenter::new(discriminant, smoothing),
            detector: Mutex::new(
                Detector::new(settings)
                    .map_err(rejected(py))?
                    .with_workspace(Arc::clone(&postures.0)),
            ),
        })
    }

    /// Features (4,), covariance (4, 4), scores (2, 10), a reason per marker, regions, index of the discriminant.
    ///
    /// `prior`: predicted state (3,), its standard deviations (3,) and the geometry (3,); None: anywhere in the workspace.
    fn detect<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArrayDyn<'py, u8>,
        prior: Option<([f64; 3], [f64; 3], [f64; 3])>,
    ) -> PyResult<Detected<'py>> {
        let frame = ArrayFrame::new(&image, self.format)?;
        let prior = prior.map(|(state, std, geometry)| Prior {
            state,
            std,
            geometry,
        });
        let predictor =
            ModelPredictor::new(&self.model, self.model_deviation, &self.workspace, prior);
        let (found, regions) = py.detach(|| {
            let mut detector = self.detector.lock().unwrap_or_else(PoisonError::into_inner);
            let (found, regions) = detector.recognise(&frame, &predictor);
            (found, described(regions))
        });
        let [a, b] = found
            .rejections
            .map(|reason| reason.map_or_else(String::new, |reason| reason.to_string()));
        let scores = found.scores.map(|score| {
            let [u, v] = score.centroid;
            [
                score.inside,
                score.coverage,
                score.exclusive,
                score.spill,
                score.edges,
                score.growth,
                score.mahalanobis_squared,
                score.pixels,
                u,
                v,
            ]
        });
        Ok((
            PyArray1::from_slice(py, &found.features),
            table(py, &found.covariance)?,
            table(py, &scores)?,
            (a, b),
            regions,
            found.discriminant,
        ))
    }

    /// The regions in windows (left, top, right, bottom).
    fn regions_in(
        &self,
        py: Python<'_>,
        image: PyReadonlyArrayDyn<'_, u8>,
        windows: Vec<[usize; 4]>,
    ) -> PyResult<Vec<Described>> {
        let frame = ArrayFrame::new(&image, self.format)?;
        let windows: Vec<Window> = windows.into_iter().map(window).collect();
        Ok(py.detach(|| {
            let mut detector = self.detector.lock().unwrap_or_else(PoisonError::into_inner);
            described(detector.regions_in(&frame, &windows))
        }))
    }

    /// The marker pixels, (h, w): those above the threshold after the low-pass.
    fn mask<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArrayDyn<'py, u8>,
    ) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let frame = ArrayFrame::new(&image, self.format)?;
        let mut mask = Array2::from_elem((frame.height(), frame.width()), false);
        py.detach(|| {
            self.segmenter.clone().each_row(&frame, |v, runs| {
                let mut row = mask.row_mut(v);
                runs.each(|start, end| {
                    row.iter_mut()
                        .take(end)
                        .skip(start)
                        .for_each(|inside| *inside = true);
                });
            });
        });
        Ok(mask.into_pyarray(py))
    }
}

fn window([left, top, right, bottom]: [usize; 4]) -> Window {
    Window {
        left,
        top,
        right,
        bottom,
    }
}

type Detected<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    (String, String),
    Vec<Described>,
    usize,
);

/// The 8-connected regions of a mask (h, w), in the order of their last rows.
#[pyfunction]
pub fn label_regions<'py>(
    py: Python<'py>,
    mask: PyReadonlyArray2<'py, bool>,
) -> PyResult<Vec<Described>> {
    let mask = mask.as_array();
    let (height, width) = mask.dim();
    if height > MAX_SIDE || width > MAX_SIDE {
        return Err(PyValueError::new_err("mask: expected sides up to 65536"));
    }
    Ok(py.detach(|| {
        let mut labeller = Labeller::default();
        let mut regions = Vec::new();
        labeller.start(width);
        for (v, row) in mask.outer_iter().enumerate() {
            let mut start = 0;
            for run in row.to_vec().chunk_by(|one, next| one == next) {
                let end = start + run.len();
                if run[0] {
                    labeller.add(v, start, end);
                }
                start = end;
            }
            labeller.end_row(|region| regions.push(region));
        }
        labeller.end_row(|region| regions.push(region));
        described(&regions)
    }))
}

/// A rejected setting as `tautscope.errors.ConfigError` about `vision`.
fn rejected(py: Python<'_>) -> impl Fn(Error) -> PyErr {
    move |Error {
              field,
              value,
              allowed,
          }| {
        errors::exception(
            py,
            "ConfigError",
            &format!("vision.{field}"),
            value,
            allowed,
        )
    }
}
