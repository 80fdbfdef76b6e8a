//! Reasons for which a band is not recognised.

use std::fmt;

/// Reason for which a band is not recognised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// The image has no region of the markers' colour, or no outline fits one.
    NoRegion,
    /// The instrument model predicts no visible bands.
    NotPredicted,
    /// Too much of the band is outside the image.
    Outside {
        /// Share of its area.
        share: f64,
    },
    /// Too little of the band has the markers' colour.
    Hidden {
        /// Share of its area that has.
        share: f64,
    },
    /// The markers' colour continues around the band.
    Spill {
        /// Share of a ring around it that has the markers' colour.
        share: f64,
    },
    /// Too little of the band's outline was found.
    MissingEdges {
        /// Share of its outline that was.
        share: f64,
    },
    /// A band found alone may be either of the two.
    Ambiguous,
    /// The bands are too far from their predicted positions.
    Elsewhere {
        /// Mahalanobis distance.
        distance: f64,
    },
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoRegion => f.write_str("no region"),
            Self::NotPredicted => f.write_str("not visible at its predicted position"),
            Self::Outside { share } => write!(f, "{:.0} % outside the image", 100.0 * share),
            Self::Hidden { share } => {
                write!(f, "only {:.0} % has the markers' colour", 100.0 * share)
            }
            Self::Spill { share } => write!(
                f,
                "{:.0} % of a ring around it has the markers' colour",
                100.0 * share
            ),
            Self::MissingEdges { share } => {
                write!(f, "only {:.0} % of its outline was found", 100.0 * share)
            }
            Self::Ambiguous => f.write_str("it may be either band"),
            Self::Elsewhere { distance } => write!(
                f,
                "{distance:.1} standard deviations from its predicted position"
            ),
        }
    }
}
