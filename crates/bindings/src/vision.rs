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
use tautscope_vision::frame::MAX_SIDE;
use tautscope_vision::runs::each_run;
use tautscope_vision::{
    ColorDiscriminant, Detector, Error, Frame, Labeller, PixelFormat, Region, Segmenter, Settings,
    Window,
};

use crate::frame::ArrayFrame;

/// The markers in frames; `tautscope.vision.MarkerDetector` is its public face.
#[pyclass(frozen, module = "tautscope._core")]
pub struct MarkerDetector {
    format: PixelFormat,
    segmenter: Segmenter,
    detector: Mutex<Detector>,
}

#[pymethods]
impl MarkerDetector {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    #[pyo3(signature = (*, pixel_format, weights, threshold, smoothing, minimum_area, gate, entry_point))]
    fn new(
        py: Python<'_>,
        pixel_format: &str,
        weights: [f64; 3],
        threshold: f64,
        smoothing: usize,
        minimum_area: u64,
        gate: f64,
        entry_point: [f64; 2],
    ) -> PyResult<Self> {
        let discriminant = ColorDiscriminant::new(weights, threshold).map_err(refused(py))?;
        let detector = Detector::new(Settings {
            discriminant,
            smoothing,
            minimum_area,
            gate,
            entry_point,
        });
        Ok(Self {
            format: PixelFormat::named(pixel_format).map_err(refused(py))?,
            segmenter: Segmenter::new(discriminant, smoothing),
            detector: Mutex::new(detector.map_err(refused(py))?),
        })
    }

    /// Features (4,), NaN if there are none; why there are none, else empty; regions (n, 7).
    fn detect<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArrayDyn<'py, u8>,
        predicted: Option<[f64; 4]>,
    ) -> PyResult<Measured<'py>> {
        let frame = ArrayFrame::new(&image, self.format)?;
        let (features, regions) = py.detach(|| {
            let mut detector = self.detector.lock().unwrap_or_else(PoisonError::into_inner);
            let detection = detector.detect(&frame, predicted);
            (detection.features, rows(detection.regions.iter().copied()))
        });
        let reason = features
            .err()
            .map_or_else(String::new, |rejection| rejection.to_string());
        let features = PyArray1::from_slice(py, &features.unwrap_or([f64::NAN; 4]));
        Ok((features, reason, regions.into_pyarray(py)))
    }

    /// The regions in windows (left, top, right, bottom): (n, 7).
    fn regions_in<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArrayDyn<'py, u8>,
        windows: Vec<[usize; 4]>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let frame = ArrayFrame::new(&image, self.format)?;
        let windows: Vec<Window> = windows.into_iter().map(window).collect();
        let regions = py.detach(|| {
            let mut detector = self.detector.lock().unwrap_or_else(PoisonError::into_inner);
            rows(detector.regions_in(&frame, &windows).iter().copied())
        });
        Ok(regions.into_pyarray(py))
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

type Measured<'py> = (Bound<'py, PyArray1<f64>>, String, Bound<'py, PyArray2<f64>>);

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
