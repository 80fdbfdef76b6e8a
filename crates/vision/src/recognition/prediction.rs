//! Predicted position and outline of both bands.

use super::outline::{Outline, extent};
use crate::math::{floor, points, real};
use crate::scan::{Frame, Window};

/// Prediction of both bands in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandPrediction {
    /// Centroids before the frame is seen: `[u_A, v_A, u_B, v_B]` (px).
    pub features: [f64; 4],
    /// Their covariance (4, 4) (px^2), symmetric, positive definite.
    pub covariance: [[f64; 4]; 4],
    /// Outlines of the bands, in the posture that the caller of [`BandPredictor::predict`] asked for.
    pub outlines: [Outline; 2],
}

impl BandPrediction {
    /// The outlines with their centroids at `features` (px).
    pub(crate) fn outlines_at(&self, features: [f64; 4]) -> [Outline; 2] {
        let [a, b] = points(features);
        [self.outlines[0].moved_to(a), self.outlines[1].moved_to(b)]
    }

    /// The part of a frame that contains both bands within 3 standard deviations and a margin (px).
    ///
    /// None if it is more than a quarter of the frame, because reading the whole frame then takes little longer, or outside.
    pub(crate) fn window(&self, frame: &impl Frame, margin: f64) -> Option<Window> {
        let sizes = [frame.width(), frame.height()].map(real);
        let outlines = self.outlines_at(self.features);
        let [[left, right], [top, bottom]] = [0, 1].map(|axis| {
            let bands = outlines.chunks(1).zip([axis, 2 + axis]);
            bands.fold([sizes[axis], 0.0_f64], |[first, last], (outline, at)| {
                let reach = 3.0 * self.covariance[at][at].sqrt() + margin;
                let [least, most] = extent(outline, axis);
                [first.min(least - reach), last.max(most + reach)]
            })
        });
        let [size_u, size_v] = sizes;
        let pixel = |value: f64, size: f64| floor(value.clamp(0.0, size));
        let window = Window {
            left: pixel(left.floor(), size_u),
            top: pixel(top.floor(), size_v),
            right: pixel(right.ceil(), size_u),
            bottom: pixel(bottom.ceil(), size_v),
        };
        let area = (right - left) * (bottom - top);
        let is_small = 4.0 * area <= size_u * size_v;
        (is_small && window.left < window.right && window.top < window.bottom).then_some(window)
    }
}

/// Discs along the section next to the tip.
pub const SECTION_DISCS: usize = 8;

/// The image of a short piece of the section next to the tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionDisc {
    /// Centre u, v (px).
    pub centre: [f64; 2],
    /// Radius (px).
    pub radius: f64,
    /// Whether it hides what it covers of band A and of band B.
    pub is_nearer: [bool; 2],
}

/// Predicts the bands from the instrument model and the prior of its posture.
pub trait BandPredictor {
    /// The prediction, with outlines in the posture that best explains the features `observed` (4,) (px)
    /// with standard deviations `std` (4,) (px; infinite: not observed).
    ///
    /// None if the bands are not visible.
    fn predict(&self, observed: [f64; 4], std: [f64; 4]) -> Option<BandPrediction>;

    /// Discs along the section, from the tip inwards, in the posture that best explains the features `observed` (4,) (px)
    /// with standard deviations `std` (4,) (px); None for a disc that has no image.
    fn section(&self, _observed: [f64; 4], _std: [f64; 4]) -> [Option<SectionDisc>; SECTION_DISCS] {
        [None; SECTION_DISCS]
    }

    /// Whether the prior is of one posture, and not of several that cover the whole workspace.
    fn is_located(&self) -> bool {
        true
    }

    /// The predictor whose prior is the posture that best explains the features `observed` (4,) (px).
    ///
    /// None if the bands are not visible there, or if the prior is of one posture already.
    fn near(&self, _observed: [f64; 4]) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// The predictor with the same prior that relies less on the configured pose of camera and bands. None if there is no such
    /// predictor.
    fn relaxed(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// The predictor without the prior: bands anywhere in the workspace. None if there is no such predictor.
    fn anywhere(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }
}
