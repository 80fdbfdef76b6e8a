//! Whether images say another slack than was learnt.

use crate::dof::PerDof;
use crate::error::{ConfigError, require_positive};
use crate::flags::{Flag, Flags};

/// Standard deviations of an offset, as it was believed, that a change of it must exceed as well.
const SURE: f64 = 3.0;

/// When a change is worth saying.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeSettings {
    /// Largest change of a contact offset [m, rad, rad].
    pub limit: PerDof<f64>,
    /// Travel of the command over which changes count together [m, rad, rad].
    pub travel: PerDof<f64>,
}

/// What an image changed of the slack believed in, where the DOF is; in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Of (`delta_minus`, `delta_plus`).
    pub offsets: [f64; 2],
    /// Their standard deviations before it.
    pub deviations: [f64; 2],
}

/// Watches what images teach.
///
/// ```text
/// changed <- k changed + change,   doubt <- max(k doubt, deviation),   k = exp(-travel / change_travel)
/// |changed| > limit + 3 doubt
/// ```
///
/// for each contact offset, with the travel of the command since the last image. What is learnt where nothing was known
/// is no surprise; that what was known is learnt anew is: either the instrument has changed, or the images are wrong
/// about place or time. Noise and what the offsets differ from place to place come back before they have added up.
///
/// Wrong where several causes change an offset and cancel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeWatch {
    settings: ChangeSettings,
    axes: PerDof<[Changed; 2]>,
    travel: PerDof<f64>,
}

impl ChangeWatch {
    /// Before the first image.
    ///
    /// # Errors
    /// A value is not a finite number above 0.
    pub fn new(settings: ChangeSettings) -> Result<Self, ConfigError> {
        for limit in settings.limit {
            require_positive("change_limit", limit)?;
        }
        for travel in settings.travel {
            require_positive("change_travel", travel)?;
        }
        Ok(Self {
            settings,
            axes: [[Changed::default(); 2]; 3],
            travel: [0.0; 3],
        })
    }

    /// What an image changed of every DOF, None if nothing, and how far the command had gone, forth and back, when it
    /// was captured [m, rad, rad].
    pub fn look(&mut self, changes: PerDof<Option<Change>>, travel: PerDof<f64>) -> Flags {
        let mut surprises = false;
        let settings = self.settings.limit.into_iter().zip(self.settings.travel);
        let axes = self.axes.iter_mut().zip(&mut self.travel).zip(settings);
        for (((sides, last), (limit, reach)), (change, travel)) in
            axes.zip(changes.into_iter().zip(travel))
        {
            let kept = libm::exp(-(travel - *last).max(0.0) / reach);
            *last = travel;
            let (offsets, deviations) = change.map_or_else(Default::default, |change| {
                (change.offsets, change.deviations)
            });
            for ((side, offset), deviation) in sides.iter_mut().zip(offsets).zip(deviations) {
                surprises |= side.add(kept, offset, deviation) > limit;
            }
        }
        Flags::when(surprises, Flag::SlackChanged)
    }
}

/// One contact offset.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Changed {
    sum: f64,
    doubt: f64,
}

impl Changed {
    /// By how much more it changed than was uncertain.
    fn add(&mut self, kept: f64, change: f64, deviation: f64) -> f64 {
        self.sum *= kept;
        if change.is_finite() {
            self.sum += change;
        }
        self.doubt = (kept * self.doubt).max(deviation);
        self.sum.abs() - SURE * self.doubt
    }
}
