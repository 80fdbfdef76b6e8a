//! Supervision: reference gate, frame gate, command limiter, monitors, and the supervisor with its reactions.

pub(crate) mod command_limiter;
pub(crate) mod flags;
pub(crate) mod frame_gate;
pub(crate) mod frame_rate;
pub(crate) mod input_device;
pub(crate) mod monitors;
pub(crate) mod motion_monitor;
pub(crate) mod prediction_monitor;
pub(crate) mod reactions;
pub(crate) mod reference_gate;
pub(crate) mod reference_limiter;
pub(crate) mod repeat;
pub(crate) mod sensor_fit;
pub(crate) mod settings;
pub(crate) mod start_check;
pub(crate) mod supervisor;
pub(crate) mod turning_points;
