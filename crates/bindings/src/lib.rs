//! `tautscope._core`: Python interface of the Rust crates, and the only crate that depends on Python.

// PyO3 hands arguments over by value.
#![allow(clippy::needless_pass_by_value)]

mod analysis;
mod arrays;
mod camera;
mod compensator;
mod description;
mod errors;
mod estimator;
mod features;
mod flags;
mod frame;
mod hysteresis;
mod instrument;
mod per_axis;
mod play;
mod predict;
mod reduction;
mod region;
mod render;
mod settings;
mod state;
mod tip_filter;
mod vision;

use pyo3::prelude::*;
use pyo3::types::PyTuple;

#[pymodule]
mod _core {
    use super::{Bound, PyModule, PyModuleMethods, PyResult, PyTuple};

    #[pymodule_export]
    use super::analysis::{move_along_curve, track_coefficients};
    #[pymodule_export]
    use super::camera::Camera;
    #[pymodule_export]
    use super::compensator::Compensator;
    #[pymodule_export]
    use super::estimator::Estimator;
    #[pymodule_export]
    use super::features::FeatureModel;
    #[pymodule_export]
    use super::hysteresis::Hysteresis;
    #[pymodule_export]
    use super::instrument::Instrument;
    #[pymodule_export]
    use super::play::Play;
    #[pymodule_export]
    use super::reduction::Reduction;
    #[pymodule_export]
    use super::render::Renderer;
    #[pymodule_export]
    use super::state::StateEstimator;
    #[pymodule_export]
    use super::tip_filter::TipFilter;
    #[pymodule_export]
    use super::vision::{MarkerDetector, PostureTable, label_regions};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add(
            "DETECTORS",
            PyTuple::new(module.py(), super::flags::names())?,
        )?;
        module.add(
            "MEANINGS",
            PyTuple::new(module.py(), super::flags::meanings())?,
        )?;
        module.add("MOST_DOFS", tautscope_core::DOFS)?;
        module.add("MOST_SENSORS", tautscope_core::SENSORS)?;
        module.add("MOST_VALUES", tautscope_core::VALUES)?;
        module.add("MOST_RANGE", tautscope_config::MOST_RANGE)?;
        module.add("OFFSET_LIMIT", tautscope_config::OFFSET_LIMIT)?;
        module.add("SPEED", tautscope_config::SPEED)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
