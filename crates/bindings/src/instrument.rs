//! `Instrument`.

use numpy::PyArray2;
use pyo3::prelude::*;
use tautscope_core as core;

use crate::arrays::{Given, columns, fixed, number, table};
use crate::description::described;
use crate::errors;

/// Kinematics of the instrument, Eq. (7), Fig. 4. Lengths in m.
///
/// Guide frame: origin where the instrument leaves the guide, z along the channel outwards. The
/// markers' distances count from the distal end of the bending section. Raises `ConfigError`.
#[pyclass(name = "Instrument", module = "tautscope._core", frozen)]
pub struct Instrument(pub core::Instrument);

#[pymethods]
impl Instrument {
    #[new]
    #[pyo3(signature = (*, bending_length, marker_a, marker_b, radius, band_length))]
    fn new(
        py: Python<'_>,
        bending_length: Given<'_>,
        marker_a: Given<'_>,
        marker_b: Given<'_>,
        radius: Given<'_>,
        band_length: Given<'_>,
    ) -> PyResult<Self> {
        core::Instrument::new(
            number("bending_length", &bending_length)?,
            number("marker_a", &marker_a)?,
            number("marker_b", &marker_b)?,
            number("radius", &radius)?,
            number("band_length", &band_length)?,
        )
        .map(Self)
        .map_err(errors::config(py))
    }

    /// f(q): centres of bands A and B (2, 3) in m for a state (3,) [m, rad, rad].
    fn markers<'py>(
        &self,
        py: Python<'py>,
        state: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let markers = self.0.markers(fixed("state", &state)?);
        table(py, &markers.map(|marker| marker.position))
    }

    /// The Jacobian (6, 3): rows as in `markers` flattened, a column per DOF.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        state: Given<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let [a, b] = self.0.markers(fixed("state", &state)?);
        let joined = |[a, b]: [[f64; 3]; 2]| [a, b].as_flattened().to_vec();
        let ([a0, a1, a2], [b0, b1, b2]) = (a.position_by_dof, b.position_by_dof);
        columns(py, &[joined([a0, b0]), joined([a1, b1]), joined([a2, b2])])
    }

    fn __repr__(&self) -> String {
        described(&self.0)
    }
}
