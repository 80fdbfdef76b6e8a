//! Image-based hysteresis reduction for flexible endoscopic instruments: models, estimation, compensation, supervision.
//!
//! One file per block of the loop. "Eq. (n)", "Fig. n" and "Table n" always mean R. Reilink,
//! S. Stramigioli, S. Misra, "Image-based hysteresis reduction for the control of flexible
//! endoscopic instruments", Mechatronics 23 (2013) 652-658, in the one sign convention of
//! decision 0001: a contact offset is input minus output.
//!
//! Constructors check their arguments and name the wrong one ([`ConfigError`]); what runs in the
//! loop cannot fail, does not allocate, reads no clock and does no I/O. Units are m, rad, s, px; one
//! value per degree of freedom (DOF) is an array in the order insertion, rotation, bending.
//!
//! The example compensates one DOF by the article's scheme; the crate `tautscope-config` builds the whole loop from TOML.
//!
//! ```
//! use tautscope_core::{Compensator, CompensatorState, Estimator, EstimatorState, Play, PlayState};
//!
//! # fn main() -> Result<(), tautscope_core::ConfigError> {
//! let unknown = Play::new(0.0, 0.0)?;
//! let (compensator, mut compensation) = (Compensator::new(5.0, 5.0)?, CompensatorState::new(unknown));
//! let (estimator, mut estimate) = (Estimator::new(0.4, 0.4, 0.25)?, EstimatorState::new(unknown));
//! let (instrument, mut tip) = (Play::new(-5.0, 5.0)?, PlayState { output: 0.0 }); // 10 mm
//!
//! for tick in 0..20_000 {
//!     let reference = 15.0 * (f64::from(tick) / 1000.0).sin();
//!     let command = compensator.step(&mut compensation, reference);
//!     let measured = instrument.step(&mut tip, command); // in use: measured in the image
//!     if estimator.update(&mut estimate, command, measured).any() {
//!         compensator.retune(&mut compensation, estimate.play());
//!     }
//! }
//! assert!((estimate.play().width() - 10.0).abs() < 0.5);
//! # Ok(())
//! # }
//! ```
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::indexing_slicing
    )
)]

#[cfg(test)]
extern crate self as tautscope_core;

#[cfg(test)]
#[path = "../tests/properties/mod.rs"]
mod properties;

mod article;
mod dof;
mod error;
mod estimation;
mod law;
mod r#loop;
mod math;
mod model;
mod settings;
mod supervision;

pub use article::compensator::{Compensator, CompensatorState};
pub use article::estimator::{Estimator, EstimatorState, Trigger, Triggers};
pub use article::play::{Play, PlayState};
pub use article::state::{StateEstimate, StateEstimator};
pub use dof::Friction;
pub use error::ConfigError;
pub use estimation::axis_filter::AxisFilter;
pub use estimation::estimate_settings::EstimateSettings;
pub use estimation::expectation::{Expected, StatePrior, StatePriors};
pub use estimation::history::{Entry, history_entries};
pub use law::settings::LawSettings;
pub use r#loop::any_loop::{BandLoop, DOFS, Loop};
pub use r#loop::axes::{
    Axes, AxesReport, Predict, Reading, Repeats, SensorProfile, StateFromSensor, VALUES,
};
pub use r#loop::best::Best;
pub use r#loop::paper::Paper;
pub use r#loop::profile::{BandProfile, Profile};
pub use r#loop::reduction::HysteresisReduction;
pub use r#loop::report::{GeometryEstimate, Report, SlackEstimate, Status};
pub use r#loop::settings::{LoopSettings, Settings};
pub use model::camera::{Camera, Pose};
pub use model::features::{FeatureModel, FeaturePrediction};
pub use model::geometry_error::GeometryDeviation;
pub use model::hysteresis::{Hysteresis, PlayPosition};
pub use model::instrument::Instrument;
pub use model::outline::BandImage;
pub use model::plays::{COEFFICIENTS, Plays};
pub use model::section::{SECTION_DISCS, SectionDisc};
pub use model::settings::{CameraSettings, InstrumentSettings, PoseSettings};
pub use settings::{ControlSettings, DofSettings};
pub use supervision::flags::{Flag, Flags};
pub use supervision::monitors::SENSORS;
pub use supervision::reactions::Reaction;
pub use supervision::settings::SafetySettings;
pub use supervision::supervisor::Supervision;
