//! Reasons for which a band is not recognised.

use std::fmt;

/// Reason for which a band is not recognised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// The image has no region of the markers' colour, or no outline fits one.
    NoRegion,
    /// The instrument model predicts no visible bands.
    NotPredicted,
    /// Too much of the band is outside the image: this share of its area.
    Outside(f64),
    /// Too little of the band has the markers' colour: this share of its area.
    Hidden(f64),
    /// The markers' colour continues around the band: this share of a ring around it has it.
    Spill(f64),
    /// Too little of the band's outline was found: this share.
    MissingEdges(f64),
    /// There is tissue between the bands, or it is not seen that there is none.
    NoInstrument,
    /// A band found alone may be either of the two.
    Ambiguous,
    /// A band was found alone, and where the instrument is, is not known.
    Alone,
    /// The bands are too far from their predicted positions: this Mahalanobis distance.
    Elsewhere(f64),
}

/// Logs contain these words, and a replay compares them.
impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoRegion => f.write_str("no region"),
            Self::NotPredicted => f.write_str("cannot be seen where it is expected"),
            Self::Outside(share) => write!(f, "{:.0} % outside the image", 100.0 * share),
            Self::Hidden(share) => write!(f, "only {:.0} % has its colour", 100.0 * share),
            Self::Spill(share) => {
                let percent = 100.0 * share;
                write!(f, "its colour goes on around it over {percent:.0} %")
            }
            Self::MissingEdges(share) => {
                write!(f, "only {:.0} % of its outline is there", 100.0 * share)
            }
            Self::NoInstrument => f.write_str("no instrument between the bands"),
            Self::Ambiguous => f.write_str("what could be it could be the other one"),
            Self::Alone => f.write_str("alone, and where the instrument is, is not known"),
            Self::Elsewhere(distance) => {
                write!(f, "{distance:.1} deviations from where it is expected")
            }
        }
    }
}
