//! Image to markers, for Python: arrays in, arrays out.

#![expect(
    clippy::needless_pass_by_value,
    reason = "PyO3 hands arguments over by value"
)]
#![expect(
    clippy::cast_precision_loss,
    reason = "counts of pixels stay far below 2^53"
)]

use std::sync::{Mutex, PoisonError};

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tautscope_core as core;
use tautscope_vision::frame::MAX_SIDE;
use tautscope_vision::runs::each_run;
use tautscope_vision::{
    ColorDiscriminant, Demands, Detector, Error, Expect, Expectation, Frame, Labeller, Outline,
    PixelFormat, Region, Segmenter, Settings, Window,
};

use crate::arrays::table;
use crate::features::FeatureModel;
use crate::frame::ArrayFrame;
use crate::region::{Described, described};

/// The markers in frames; `tautscope.loop.vision.MarkerDetector` is its public face.
#[pyclass(frozen, module = "tautscope._core")]
pub struct MarkerDetector {
    format: PixelFormat,
    model: core::FeatureModel,
    model_deviation: f64,
    demands: Demands,
    segmenter: Segmenter,
    detector: Mutex<Detector>,
}

#[pymethods]
impl MarkerDetector {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    #[pyo3(signature = (model, *, pixel_format, weights, threshold, smoothing, minimum_area, model_deviation, demands, alternatives))]
    fn new(
        py: Python<'_>,
        model: &FeatureModel,
        pixel_format: &str,
        weights: [f64; 3],
        threshold: f64,
        smoothing: usize,
        minimum_area: u64,
        model_deviation: f64,
        demands: [f64; 7],
        alternatives: Vec<([f64; 3], f64)>,
    ) -> PyResult<Self> {
        let discriminant = ColorDiscriminant::new(weights, threshold).map_err(refused(py))?;
        let detector = Detector::new(Settings {
            discriminant,
            smoothing,
            minimum_area,
        });
        let others: Result<Vec<_>, _> = alternatives
            .into_iter()
            .map(|(weights, threshold)| ColorDiscriminant::new(weights, threshold))
            .collect();
        Ok(Self {
            format: PixelFormat::named(pixel_format).map_err(refused(py))?,
            model: model.0,
            model_deviation,
            demands: demands.into(),
            segmenter: Segmenter::new(discriminant, smoothing),
            detector: Mutex::new(
                detector
                    .map_err(refused(py))?
                    .with_alternatives(&others.map_err(refused(py))?),
            ),
        })
    }

    /// Features (4,), covariance (4, 4), evidence (2, 9), a reason per marker, regions.
    ///
    /// `states` (n, 3): where the instrument may be, each with the standard deviations `deviation` (3,).
    fn detect<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArrayDyn<'py, u8>,
        states: Vec<[f64; 3]>,
        deviation: [f64; 3],
    ) -> PyResult<Measured<'py>> {
        let frame = ArrayFrame::new(&image, self.format)?;
        let expect = Believed {
            model: &self.model,
            beliefs: core::Beliefs {
                states: &states,
                deviation,
                model_deviation: self.model_deviation,
            },
        };
        let demands = if states.len() > 1 {
            self.demands.without_a_place()
        } else {
            self.demands
        };
        let (verdict, regions) = py.detach(|| {
            let mut detector = self.detector.lock().unwrap_or_else(PoisonError::into_inner);
            let (verdict, regions) = detector.recognise(&frame, &expect, &demands);
            (verdict, described(regions))
        });
        let [a, b] = verdict
            .reasons
            .map(|reason| reason.map_or_else(String::new, |reason| reason.to_string()));
        let evidence = verdict.bands.map(|band| {
            let [u, v] = band.centroid;
            [
                band.inside,
                band.coverage,
                band.own,
                band.spill,
                band.edges,
                band.bloom,
                band.surprise,
                u,
                v,
            ]
        });
        Ok((
            PyArray1::from_slice(py, &verdict.features),
            table(py, &verdict.covariance)?,
            table(py, &evidence)?,
            (a, b),
            regions,
            verdict.discriminant,
        ))
    }

    /// The regions in windows (left, top, right, bottom), as in `detect`.
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

    /// What passes the threshold after the low-pass, (h, w).
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

type Measured<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    (String, String),
    Vec<Described>,
    usize,
);

/// What the core's model says of where the instrument may be, as the vision asks it.
struct Believed<'a> {
    model: &'a core::FeatureModel,
    beliefs: core::Beliefs<'a>,
}

impl Expect for Believed<'_> {
    fn expect(&self, seen: [f64; 4], deviation: [f64; 4]) -> Option<Expectation> {
        let expected = self.model.expect(&self.beliefs, seen, deviation)?;
        Some(Expectation {
            features: expected.features,
            covariance: expected.covariance,
            bands: expected.bands.map(|band| Outline {
                corners: band.outline,
                centroid: band.centroid,
                area: band.area,
            }),
        })
    }
}

/// The 8-connected regions of a mask (h, w), in the order of their last rows: (n, 7).
#[pyfunction]
pub fn label_regions<'py>(
    py: Python<'py>,
    mask: PyReadonlyArray2<'py, bool>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mask = mask.as_array();
    let (height, width) = mask.dim();
    if height > MAX_SIDE || width > MAX_SIDE {
        return Err(PyValueError::new_err("mask: expected sides up to 65536"));
    }
    let regions = py.detach(|| {
        let mut labeller = Labeller::default();
        let mut regions = Vec::new();
        labeller.start(width);
        for (v, row) in mask.outer_iter().enumerate() {
            let row = row.to_vec();
            each_run(
                &row,
                |inside| *inside,
                |start, end| labeller.add(v, start, end),
            );
            labeller.end_row(|region| regions.push(region));
        }
        labeller.end_row(|region| regions.push(region));
        rows(regions.into_iter())
    });
    Ok(regions.into_pyarray(py))
}

/// One row per region: area, centroid u, v, then left, top, width, height of its box [px].
fn rows(regions: impl Iterator<Item = Region>) -> Array2<f64> {
    let rows: Vec<[f64; 7]> = regions
        .map(|region| {
            let [u, v] = region.centroid();
            let sides = [region.right - region.left, region.bottom - region.top];
            let [left, top, width, height] =
                [region.left, region.top, sides[0], sides[1]].map(|side| side as f64);
            [region.area as f64, u, v, left, top, width, height]
        })
        .collect();
    Array2::from(rows)
}

/// A refused setting as `tautscope.errors.ConfigError` about `vision`.
fn refused(py: Python<'_>) -> impl Fn(Error) -> PyErr {
    move |error| {
        let facts = (
            format!("vision.{}", error.field),
            error.value,
            error.allowed,
        );
        py.import("tautscope.errors")
            .and_then(|errors| errors.getattr("ConfigError"))
            .and_then(|class| class.call1(facts))
            .map_or_else(|failure| failure, PyErr::from_value)
    }
}
