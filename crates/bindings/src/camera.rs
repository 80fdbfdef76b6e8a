//! `Camera`.

use numpy::PyArray2;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Given, fixed, number, rows, table};
use crate::description::described;
use crate::errors;

/// Pinhole camera with `OpenCV`'s distortion k1, k2, p1, p2, k3, k4, k5, k6, Eq. (8). Raises `ConfigError`.
#[pyclass(name = "Camera", module = "tautscope._core", frozen)]
pub struct Camera(pub core::Camera);

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (*, fx, fy, cx, cy, distortion))]
    fn new(
        py: Python<'_>,
        fx: Given<'_>,
        fy: Given<'_>,
        cx: Given<'_>,
        cy: Given<'_>,
        distortion: Given<'_>,
    ) -> PyResult<Self> {
        let focal = [number("fx", &fx)?, number("fy", &fy)?];
        let centre = [number("cx", &cx)?, number("cy", &cy)?];
        core::Camera::new(focal, centre, fixed("distortion", &distortion)?)
            .map(Self)
            .map_err(errors::config(py))
    }

    /// Pixels (n, 2) of points (n, 3) in m in the camera frame; NaN at or behind the camera.
    fn project<'py>(
        &self,
        py: Python<'py>,
        points: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let invisible = [f64::NAN; 2];
        let pixels: Vec<[f64; 2]> = rows("points", &points)?
            .into_iter()
            .map(|point| self.0.project(point).map_or(invisible, |image| image.pixel))
            .collect();
        table(py, &pixels)
    }

    /// d pixel / d point (2, 3) in px/m at a point (3,) in m in the camera frame.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        point: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let invisible = [[f64::NAN; 3]; 2];
        let image = self.0.project(fixed("point", &point)?);
        table(py, &image.map_or(invisible, |image| image.pixel_by_point))
    }

    fn __repr__(&self) -> String {
        described(&self.0)
    }
}
