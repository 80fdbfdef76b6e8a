//! Why a band is not found.

use std::fmt;

/// Why a band is not found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// Nothing has the markers' colour.
    NoRegion,
    /// The model of the instrument has no image of the bands where the loop believes it to be.
    Unseen,
    /// Too much of it is outside the image.
    Outside {
        /// Share of its area.
        share: f64,
    },
    /// Too little of what should be it has its colour.
    Hidden {
        /// Share that has.
        share: f64,
    },
    /// The colour goes on around it.
    Larger {
        /// Share of a ring around it that has its colour.
        share: f64,
    },
    /// The colour does not end where its outline does.
    Shape {
        /// Share of its outline where it does.
        share: f64,
    },
    /// What could be it could as well be the other one.
    Either,
    /// The two are not where they may be.
    Elsewhere {
        /// Mahalanobis distance from the expectation.
        distance: f64,
    },
}

impl fmt::Display for Rejection {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoRegion => formatter.write_str("no region"),
            Self::Unseen => formatter.write_str("cannot be seen where it is expected"),
            Self::Outside { share } => {
                write!(formatter, "{:.0} % outside the image", 100.0 * share)
            }
            Self::Hidden { share } => {
                write!(formatter, "only {:.0} % has its colour", 100.0 * share)
            }
            Self::Larger { share } => {
                write!(
                    formatter,
                    "its colour goes on around it over {:.0} %",
                    100.0 * share
                )
            }
            Self::Shape { share } => {
                write!(
                    formatter,
                    "only {:.0} % of its outline is there",
                    100.0 * share
                )
            }
            Self::Either => formatter.write_str("what could be it could be the other one"),
            Self::Elsewhere { distance } => {
                write!(
                    formatter,
                    "{distance:.1} deviations from where it is expected"
                )
            }
        }
    }
}
