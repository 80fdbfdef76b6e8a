//! Image-based hysteresis reduction for flexible endoscopic instruments: the control law.
//!
//! One file per block of the loop. "Eq. (n)", "Fig. n" and "Table n" always mean R. Reilink,
//! S. Stramigioli, S. Misra, "Image-based hysteresis reduction for the control of flexible
//! endoscopic instruments", Mechatronics 23 (2013) 652-658, in the one sign convention of
//! decision 0001: a contact offset is input minus output.
//!
//! Constructors check their arguments and say which is wrong ([`ConfigError`]); what runs in the
//! loop cannot fail, does not allocate, reads no clock and does no I/O. Units are m, rad, s, px.
//!
//! One DOF in the article's way; `tests/no_alloc.rs` puts a whole loop together.
//!
//! ```
//! use tautscope_core::{Compensator, CompensatorState, Estimator, EstimatorState, Play, PlayState};
//!
//! # fn main() -> Result<(), tautscope_core::ConfigError> {
//! let unknown = Play::new(0.0, 0.0)?;
//! let (compensator, mut lead) = (Compensator::new(5.0, 5.0)?, CompensatorState::new(unknown));
//! let (estimator, mut learnt) = (Estimator::new(0.4, 0.4, 0.25)?, EstimatorState::new(unknown));
//! let (instrument, mut tip) = (Play::new(-5.0, 5.0)?, PlayState { output: 0.0 }); // 10 mm
//!
//! for tick in 0..20_000 {
//!     let reference = 15.0 * (f64::from(tick) / 1000.0).sin();
//!     let command = compensator.step(&mut lead, reference);
//!     let measured = instrument.step(&mut tip, command); // yours: what the image says
//!     if estimator.update(&mut learnt, command, measured).any() {
//!         compensator.retune(&mut lead, learnt.play());
//!     }
//! }
//! assert!((learnt.play().width() - 10.0).abs() < 0.5);
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

mod adaptive;
mod article;
mod dof;
mod error;
mod estimation;
mod r#loop;
mod math;
mod model;
mod settings;
mod supervision;

pub use adaptive::axis::AdaptiveAxis;
pub use adaptive::contact::ContactTest;
pub use adaptive::friction::{Friction, FrictionSettings, SlackShare};
pub use adaptive::lead::LeadLaw;
pub use adaptive::offset_map::{OffsetMap, OffsetPrior, Side};
pub use adaptive::settings::AdaptiveSettings;
pub use adaptive::sharing::Sharing;
pub use adaptive::smoother::Smoother;
pub use adaptive::withheld::{ChangeLimit, Withheld};
pub use article::compensator::{Compensator, CompensatorState};
pub use article::estimator::{Estimator, EstimatorState, Trigger, Triggers};
pub use article::play::{ContactMode, Play, PlayState};
pub use article::play_limit::PlayLimit;
pub use article::state::{StateEstimate, StateEstimator};
pub use dof::{PerDof, all_finite};
pub use error::ConfigError;
pub use estimation::expectation::{Beliefs, Expected};
pub use estimation::posture::Belief;
pub use estimation::weighted::{WeightedEstimate, WeightedEstimator, WeightedSettings};
pub use estimation::whereabouts::{Whereabouts, WhereaboutsSettings};
pub use r#loop::axis::{ArticleAxis, Axis, Lesson};
pub use r#loop::history::{Entry, History};
pub use r#loop::reduction::{HysteresisReduction, Report, StateEstimation, Status};
pub use model::camera::{Camera, Pose, Projection};
pub use model::features::{FeatureModel, FeaturePrediction};
pub use model::instrument::{Instrument, Marker};
pub use model::outline::{BandImage, OUTLINE};
pub use settings::DofSettings;
pub use supervision::change_watch::{ChangeSettings, ChangeWatch};
pub use supervision::command_limiter::{CommandLimiter, LimiterResult};
pub use supervision::flags::{Flag, Flags};
pub use supervision::frame_gate::{FrameArrival, FrameGate, ImageIdentity};
pub use supervision::grip::{Grip, GripSettings, Sighting};
pub use supervision::input_device::InputDeviceMonitor;
pub use supervision::monitors::{Monitors, Supervision};
pub use supervision::motion_monitor::MotionMonitor;
pub use supervision::reactions::{Clear, Reaction, Rule, Source, TABLE};
pub use supervision::reference_gate::{GatedReference, ReferenceGate};
pub use supervision::settings::SafetySettings;
pub use supervision::supervisor::{Event, Supervisor};
pub use supervision::turning_points::TurningPoints;
