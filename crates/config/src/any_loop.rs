//! The loop of a robot, and what selects it.

use std::ops::{Deref, DerefMut};

use serde::Deserialize;
use serde::de::IgnoredAny;
use tautscope_core as core;

/// The loop of a robot.
pub enum AnyLoop {
    /// Of the article's instrument.
    Bands(Box<dyn core::BandLoop + Send + Sync>),
    /// Of the degrees of freedom of `[[dof]]`.
    Axes(Box<dyn core::Axes + Send + Sync>),
}

/// What selects the loop of a configuration.
#[derive(Debug, Clone, Deserialize)]
pub struct Selection {
    #[serde(default)]
    profile: Profile,
    #[serde(default)]
    dof: Vec<IgnoredAny>,
}

/// The profiles of the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Profile {
    /// The article's blocks.
    Paper,
    /// The vector law on one linear filter of fixed plays.
    #[default]
    Best,
}

impl Selection {
    /// Whether the configuration has `[[dof]]`.
    pub const fn has_axes(&self) -> bool {
        !self.dof.is_empty()
    }

    /// The loop of the article's instrument at rest.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn build_bands(&self, settings: &core::Settings) -> Result<AnyLoop, core::ConfigError> {
        let storage = vec![core::Entry::BLANK; entries(&settings.control)?];
        Ok(AnyLoop::Bands(match self.profile {
            Profile::Paper => Box::new(Bands::<core::Paper>::new(settings, storage)?),
            Profile::Best => Box::new(Bands::<core::Best>::new(settings, storage)?),
        }))
    }
}

/// Longest history, as in `python/tautscope/config/control.py`.
const MOST_TICKS: usize = 1024;

/// Entries of the history that a loop needs.
///
/// # Errors
/// They are more than a history has.
pub(crate) fn entries(control: &core::ControlSettings) -> Result<usize, core::ConfigError> {
    let found = core::history_entries(control.history, control.period);
    // Two beside the periods: `history_entries`.
    if found > MOST_TICKS + 2 {
        return Err(core::ConfigError {
            field: "history",
            value: control.history,
            allowed: "at most 1024 control periods",
        });
    }
    Ok(found)
}

type Bands<P> = core::HysteresisReduction<P, Vec<core::Entry>>;

impl Deref for AnyLoop {
    type Target = dyn core::Loop;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Bands(inner) => inner.as_ref(),
            Self::Axes(inner) => inner.as_ref(),
        }
    }
}

impl DerefMut for AnyLoop {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::Bands(inner) => inner.as_mut(),
            Self::Axes(inner) => inner.as_mut(),
        }
    }
}
