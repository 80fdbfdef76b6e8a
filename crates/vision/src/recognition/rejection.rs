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
    /// There is tissue between the bands, or it is not seen that there is none.
    NoInstrument,
    /// A band found alone may be either of the two.
    Ambiguous,
    /// The bands are too far from their predicted positions.
    Elsewhere {
        /// Mahalanobis distance.
        distance: f64,
    },
}

/// Logs contain these words, and a replay compares them.
impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = |share: &f64| 100.0 * share;
        match self {
            Self::NoRegion => f.write_str("no region"),
            Self::NotPredicted => f.write_str("cannot be seen where it is expected"),
            Self::Outside { share } => write!(f, "{:.0} % outside the image", percent(share)),
            Self::Hidden { share } => write!(f, "only {:.0} % has its colour", percent(share)),
            Self::Spill { share } => {
                write!(
                    f,
                    "its colour goes on around it over {:.0} %",
                    percent(share)
                )
            }
            Self::MissingEdges { share } => {
                write!(f, "only {:.0} % of its outline is there", percent(share))
            }
            Self::NoInstrument => f.write_str("no instrument between the bands"),
            Self::Ambiguous => f.write_str("what could be it could be the other one"),
            Self::Elsewhere { distance } => {
                write!(f, "{distance:.1} deviations from where it is expected")
            }
        }
    }
}
