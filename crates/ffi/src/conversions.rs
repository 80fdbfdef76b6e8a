//! Results of the loop and of the detection as structures and enumerations of the header.

use tautscope_core as core;
use tautscope_vision as vision;

use crate::types::{
    TautscopeHysteresis, TautscopeReaction, TautscopeRejection, TautscopeReport, TautscopeStatus,
    TautscopeSupervision, TautscopeTipReport, TautscopeTrigger,
};

/// The bits of a set of flags.
pub fn bits(flags: core::Flags) -> u32 {
    let mut bits = 0;
    for (index, flag) in core::Flag::ALL.iter().enumerate() {
        bits |= u32::from(flags.contains(*flag)) << index;
    }
    bits
}

impl From<core::Status> for TautscopeStatus {
    fn from(status: core::Status) -> Self {
        match status {
            core::Status::Ok => Self::Ok,
            core::Status::Held => Self::Held,
            core::Status::Partial => Self::Partial,
            core::Status::NoMarkers => Self::NoMarkers,
            core::Status::Stale => Self::Stale,
            core::Status::Duplicate => Self::Duplicate,
            core::Status::Refused => Self::Refused,
        }
    }
}

impl From<core::Reaction> for TautscopeReaction {
    fn from(reaction: core::Reaction) -> Self {
        match reaction {
            core::Reaction::None => Self::None,
            core::Reaction::Warn => Self::Warn,
            core::Reaction::HoldEstimate => Self::HoldEstimate,
            core::Reaction::Fade => Self::Fade,
            core::Reaction::PassThrough => Self::PassThrough,
            core::Reaction::HoldMotion => Self::HoldMotion,
            core::Reaction::QuickStop => Self::QuickStop,
            core::Reaction::Disable => Self::Disable,
        }
    }
}

impl From<Option<core::Trigger>> for TautscopeTrigger {
    fn from(trigger: Option<core::Trigger>) -> Self {
        match trigger {
            None => Self::None,
            Some(core::Trigger::Contact) => Self::Contact,
            Some(core::Trigger::Violation) => Self::Violation,
        }
    }
}

impl From<Option<vision::Rejection>> for TautscopeRejection {
    fn from(rejection: Option<vision::Rejection>) -> Self {
        match rejection {
            None => Self::None,
            Some(vision::Rejection::NoRegion) => Self::NoRegion,
            Some(vision::Rejection::NotPredicted) => Self::NotPredicted,
            Some(vision::Rejection::Outside { .. }) => Self::Outside,
            Some(vision::Rejection::Hidden { .. }) => Self::Hidden,
            Some(vision::Rejection::Spill { .. }) => Self::Spill,
            Some(vision::Rejection::MissingEdges { .. }) => Self::MissingEdges,
            Some(vision::Rejection::NoInstrument) => Self::NoInstrument,
            Some(vision::Rejection::Ambiguous) => Self::Ambiguous,
            Some(vision::Rejection::Elsewhere { .. }) => Self::Elsewhere,
            Some(vision::Rejection::Alone) => Self::Alone,
        }
    }
}

impl From<core::Supervision> for TautscopeSupervision {
    fn from(now: core::Supervision) -> Self {
        Self {
            reaction: now.reaction.into(),
            flags: bits(now.flags),
            latched: bits(now.latched),
            reserved: 0,
            share: now.lead,
        }
    }
}

impl TautscopeReport {
    /// The report of an image that was captured at a time in s.
    pub fn new(report: &core::Report, captured_at: f64) -> Self {
        Self {
            // Checked against the caller's where it is written.
            size: 0,
            status: report.status.into(),
            reaction: report.supervision.reaction.into(),
            flags: bits(report.supervision.flags),
            captured_at,
            state_estimate: report.estimate.state,
            predicted_state: report.predicted_state,
            predicted_features: report.predicted_features,
            innovation: report.estimate.innovation,
            deviation: report.estimate.deviation,
            state_deviation: report.state_deviation,
            delta_minus: report.play.map(|play| play.delta_minus()),
            delta_plus: report.play.map(|play| play.delta_plus()),
            triggers_minus: report.triggers.map(|triggers| triggers.minus.into()),
            triggers_plus: report.triggers.map(|triggers| triggers.plus.into()),
            is_observable: report.estimate.observable.map(u32::from),
            reserved: 0,
        }
    }
}

impl TautscopeTipReport {
    /// The report of a measurement at a time in s.
    pub fn new(report: &core::AxesReport, axes: &dyn core::Axes, captured_at: f64) -> Self {
        let (now, play) = (axes.supervision(), axes.play());
        Self {
            size: 0,
            status: report.status.into(),
            reaction: now.reaction.into(),
            flags: bits(now.flags),
            captured_at,
            state_estimate: report.state,
            state_deviation: report.state_deviation,
            predicted_state: report.predicted_state,
            predicted_values: report.predicted,
            innovation: report.innovation,
            delta_minus: play.map(|play| play.delta_minus()),
            delta_plus: play.map(|play| play.delta_plus()),
            triggers_minus: report.triggers.map(|triggers| triggers.minus.into()),
            triggers_plus: report.triggers.map(|triggers| triggers.plus.into()),
            is_observable: report.observable.map(u32::from),
        }
    }
}

impl From<core::SlackEstimate<{ core::DOFS }>> for TautscopeHysteresis {
    fn from(found: core::SlackEstimate<{ core::DOFS }>) -> Self {
        Self {
            half_width: found.half_width,
            width_std: found.width_std,
            centre: found.centre,
            gain: found.gain,
            gain_std: found.gain_std,
        }
    }
}
