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

use numpy::ndarray::{Array2, ArrayView3, Axis};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tautscope_vision::frame::MAX_SIDE;
use tautscope_vision::segment::each_run;
use tautscope_vision::{
    ColorDiscriminant, Detector, Error, Frame, Labeller, Region, Segmenter, Settings,
};

/// The markers in frames; `tautscope.vision.MarkerDetector` is its public face.
#[pyclass(frozen, module = "tautscope._core")]
pub struct MarkerDetector {
    segmenter: Segmenter,
    detector: Mutex<Detector>,
}

#[pymethods]
impl MarkerDetector {
    #[new]
    #[pyo3(signature = (*, weights, threshold, smoothing, minimum_area, gate, entry_point))]
    fn new(
        weights: [f64; 3],
        threshold: f64,
        smoothing: usize,
        minimum_area: u64,
        gate: f64,
        entry_point: [f64; 2],
    ) -> PyResult<Self> {
        let discriminant = ColorDiscriminant::new(weights, threshold).map_err(refused)?;
        let detector = Detector::new(Settings {
            discriminant,
            smoothing,
            minimum_area,
            gate,
            entry_point,
        });
        Ok(Self {
            segmenter: Segmenter::new(discriminant, smoothing),
            detector: Mutex::new(detector.map_err(refused)?),
        })
    }

    /// Features (4,), NaN if there are none; why there are none, else empty; regions (n, 7).
    fn detect<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArray3<'py, u8>,
        predicted: Option<[f64; 4]>,
    ) -> PyResult<Measured<'py>> {
        let frame = ArrayFrame::new(image.as_array())?;
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

    /// What passes the threshold after the low-pass, (h, w).
    fn mask<'py>(
        &self,
        py: Python<'py>,
        image: PyReadonlyArray3<'py, u8>,
    ) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let frame = ArrayFrame::new(image.as_array())?;
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

type Measured<'py> = (Bound<'py, PyArray1<f64>>, String, Bound<'py, PyArray2<f64>>);

/// The 8-connected regions of a mask (h, w), in the order of their first pixels: (n, 7).
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
        labeller.start(width, height);
        for (v, row) in mask.outer_iter().enumerate() {
            labeller.next_row();
            let row = row.to_vec();
            each_run(
                &row,
                |inside| *inside,
                |start, end| labeller.add(v, start, end),
            );
        }
        rows(labeller.regions(1))
    });
    Ok(regions.into_pyarray(py))
}

/// An array seen as a frame: the pixels of a row are contiguous, the rows may lie anywhere.
struct ArrayFrame<'a>(ArrayView3<'a, u8>);

impl<'a> ArrayFrame<'a> {
    fn new(image: ArrayView3<'a, u8>) -> PyResult<Self> {
        let (height, width, channels) = image.dim();
        let sides = 1..=MAX_SIDE;
        let frame = Self(image);
        if !(sides.contains(&height) && sides.contains(&width) && channels == 3)
            || frame.row(0).len() != 3 * width
        {
            return Err(PyValueError::new_err(
                "image: expected (height, width, 3), sides 1 to 65536, pixels contiguous in a row",
            ));
        }
        Ok(frame)
    }
}

impl Frame for ArrayFrame<'_> {
    fn width(&self) -> usize {
        self.0.dim().1
    }

    fn height(&self) -> usize {
        self.0.dim().0
    }

    fn row(&self, v: usize) -> &[u8] {
        let row = self.0.index_axis_move(Axis(0), v);
        row.to_slice().unwrap_or_default()
    }
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

fn refused(error: Error) -> PyErr {
    PyValueError::new_err(error.to_string())
}
