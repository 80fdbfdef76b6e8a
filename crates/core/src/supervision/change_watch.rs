//! Whether images say another slack than was learnt.

use crate::dof::PerDof;
use crate::error::{ConfigError, require_positive};
use crate::supervision::flags::{Flag, Flags};

/// Travel without much to learn, in `change_travel`, after which an offset counts as learnt.
const CALM: f64 = 2.0;

/// When a change is worth saying.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeSettings {
    /// Largest change of a contact offset that was learnt [m, rad, rad].
    pub limit: PerDof<f64>,
    /// Travel of the command over which changes count together [m, rad, rad].
    pub travel: PerDof<f64>,
}

/// Watches what images teach.
///
/// ```text
/// changed <- exp(-travel / change_travel) changed + change,   |changed| > change_limit
/// ```
///
/// for each contact offset, with the travel of the command since the last image. That an offset is learnt is no
/// surprise; that it is learnt anew is, once it has stayed within half the limit for two `change_travel`: either the
/// instrument has changed, or the images are wrong about place or time. Noise, and what an offset differs from place
/// to place, comes back before it has added up.
///
/// Wrong where two causes change an offset and cancel, and about what images do to the predicted state alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeWatch {
    settings: ChangeSettings,
    offsets: PerDof<[Changed; 2]>,
    travel: PerDof<f64>,
}

impl ChangeWatch {
    /// Before the first image.
    ///
    /// # Errors
    /// A value is not a finite number above 0.
    pub fn new(settings: ChangeSettings) -> Result<Self, ConfigError> {
        for (field, lengths) in [
            ("change_limit", settings.limit),
            ("change_travel", settings.travel),
        ] {
            for length in lengths {
                require_positive(field, length)?;
            }
        }
        Ok(Self {
            settings,
            offsets: [[Changed::default(); 2]; 3],
            travel: [0.0; 3],
        })
    }

    /// What an image changed of (`delta_minus`, `delta_plus`) where each DOF is, and how far the command had gone,
    /// forth and back, when it was captured [m, rad, rad].
    pub fn look(&mut self, changes: PerDof<[f64; 2]>, travel: PerDof<f64>) -> Flags {
        let mut surprises = false;
        let settings = self.settings.limit.into_iter().zip(self.settings.travel);
        let axes = self.offsets.iter_mut().zip(&mut self.travel).zip(settings);
        let news = changes.into_iter().zip(travel);
        for (((offsets, last), (limit, reach)), (changes, travel)) in axes.zip(news) {
            let moved = (travel - *last).max(0.0) / reach;
            *last = travel;
            for (offset, change) in offsets.iter_mut().zip(changes) {
                offset.add(change, moved, limit);
                surprises |= offset.calm >= CALM && offset.sum.abs() > limit;
            }
        }
        Flags::when(surprises, Flag::SlackChanged)
    }
}

/// One contact offset.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Changed {
    sum: f64,
    /// Travel for which it has stayed as it is; once it counts as learnt, no more is counted.
    calm: f64,
}

impl Changed {
    fn add(&mut self, change: f64, moved: f64, limit: f64) {
        self.sum *= libm::exp(-moved);
        if change.is_finite() {
            self.sum += change;
        }
        if self.calm < CALM {
            self.calm = if self.sum.abs() > limit / 2.0 {
                0.0
            } else {
                self.calm + moved
            };
        }
    }
}
