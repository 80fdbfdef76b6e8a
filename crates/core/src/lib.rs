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
#![no_std]
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

mod adaptive;
mod axis;
mod camera;
mod change_watch;
mod clutch;
mod compensator;
mod contact;
mod device_watch;
mod dof;
mod error;
mod estimator;
mod expectation;
mod features;
mod flags;
mod frame_watch;
mod friction;
mod grip;
mod guards;
mod history;
mod instrument;
mod lead;
mod limits;
mod linear;
mod monitor;
mod motion_watch;
mod normal_equations;
mod offset_map;
mod outline;
mod play;
mod posture;
mod reactions;
mod reduction;
mod sharing;
mod sight;
mod slack;
mod smoother;
mod state;
mod supervisor;
mod swings;
mod weighted;
mod whereabouts;
mod withheld;

pub use adaptive::{AdaptiveAxis, AdaptiveSettings};
pub use axis::{ArticleAxis, Axis, Lesson};
pub use camera::{Camera, Pose, Projection};
pub use change_watch::{ChangeSettings, ChangeWatch};
pub use clutch::{Admission, Clutch, ClutchSettings};
pub use compensator::{Compensator, CompensatorState};
pub use contact::ContactTest;
pub use device_watch::{DeviceSettings, DeviceWatch};
pub use dof::{PerDof, all_finite};
pub use error::ConfigError;
pub use estimator::{Estimator, EstimatorState, Trigger, Triggers};
pub use expectation::{Beliefs, Expected};
pub use features::{FeatureModel, FeaturePrediction};
pub use flags::{Flag, Flags};
pub use frame_watch::{Arrival, FrameSettings, FrameWatch, Picture};
pub use friction::{Friction, FrictionSettings, SlackShare};
pub use grip::{Grip, GripSettings, Sighting};
pub use guards::{GuardSettings, Guards, Supervision};
pub use history::{Entry, History};
pub use instrument::{Instrument, Marker};
pub use lead::LeadLaw;
pub use limits::PlayLimit;
pub use monitor::{Monitor, MonitorSettings, Verdict};
pub use motion_watch::{MotionSettings, MotionWatch};
pub use offset_map::{OffsetMap, OffsetPrior, Side};
pub use outline::{BandImage, OUTLINE};
pub use play::{ContactMode, Play, PlayState};
pub use posture::Belief;
pub use reactions::{Clear, Reaction, Rule, Source, TABLE};
pub use reduction::{HysteresisReduction, Report, StateEstimation, Status};
pub use sharing::Sharing;
pub use smoother::Smoother;
pub use state::{StateEstimate, StateEstimator};
pub use supervisor::{Event, Supervisor, SupervisorSettings};
pub use swings::Swings;
pub use weighted::{WeightedEstimate, WeightedEstimator, WeightedSettings};
pub use whereabouts::{Whereabouts, WhereaboutsSettings};
pub use withheld::{ChangeLimit, Withheld};
