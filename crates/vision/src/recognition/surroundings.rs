//! What is between the bands and beside them: between the bands of an instrument is the instrument, not tissue.

use super::outline::{OUTLINE_CORNERS, Outline};
use super::prediction::{SECTION_DISCS, SectionDisc};
use crate::scan::{Affine, Frame, weighted_sum};

/// Weights of B, G, R for green minus red: about 0 for grey or black plastic, far below 0 for tissue, above 0 for a band.
const GREEN_MINUS_RED: [f64; 3] = [0.0, 1.0, -1.0];
/// Samples greener than this are a band's (grey levels).
const BAND: f64 = 8.0;
/// Tissue is at least this much redder than green (grey levels); what is less may be tissue or not.
const LEAST_REDNESS: f64 = 10.0;
/// Instrument has at most this share of the redness of the tissue beside it.
const LARGEST_SHARE: f64 = 0.6;
/// Least [`section_contrast`] of an instrument.
pub const LEAST_CONTRAST: f64 = 0.4;
/// With fewer samples than this nothing is decided.
const LEAST_SAMPLES: f64 = 6.0;
/// Places of samples between the bands, as shares of the way from A to B, and beyond A.
const BETWEEN: [f64; 3] = [0.25, 0.5, 0.75];
const BEYOND: [f64; 3] = [-0.12, -0.2, -0.28];
/// Places of samples beside the instrument, and their distances from it (px).
const ALONG: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
const BESIDE: [f64; 3] = [4.0, 6.0, 8.0];

/// Corners of an outline on its proximal rim; the corners of the distal rim have the opposite order.
const RIM: usize = OUTLINE_CORNERS / 2;

/// Whether there is an instrument between the bands and beyond band A; None if the image does not show it.
///
/// Green minus red of tissue is negative and of plastic about 0, at any exposure. Samples that are as green as a band are
/// left out: letters of the bands' colour have more letters between them.
///
/// Wrong where the instrument is as red as the tissue.
pub fn is_instrument(frame: &impl Frame, [a, b]: &[Outline; 2]) -> Option<bool> {
    let affine = Affine::new(GREEN_MINUS_RED, frame.format());
    let sample = |at: [f64; 2]| weighted_sum(frame, &affine, at);
    let mut inner = Mean::default();
    for index in 2..RIM - 2 {
        let [near, far] = [a.corners[OUTLINE_CORNERS - 1 - index], b.corners[index]];
        let own = a.corners[index];
        let between = BETWEEN.map(|share| along(near, far, share));
        let beyond = BEYOND.map(|share| along(own, far, share));
        for at in between.into_iter().chain(beyond) {
            inner.add(sample(at).filter(|green| *green <= BAND));
        }
    }
    let mut sides = [Mean::default(); 2];
    for share in ALONG {
        let ends = [0, RIM - 1].map(|index| {
            along(
                a.corners[OUTLINE_CORNERS - 1 - index],
                b.corners[index],
                share,
            )
        });
        let [du, dv] = [ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]];
        let width = du.hypot(dv).max(1e-6);
        for ((side, end), sign) in sides.iter_mut().zip(ends).zip([1.0, -1.0]) {
            for distance in BESIDE {
                let reach = sign * distance / width;
                side.add(sample([end[0] + reach * du, end[1] + reach * dv]));
            }
        }
    }
    let tissue = sides.iter().filter_map(Mean::value).fold(0.0, f64::min);
    let inner = inner.value()?;
    (tissue < -LEAST_REDNESS).then_some(inner > LARGEST_SHARE * tissue)
}

/// By how much less red the section next to the tip is than the tissue beside it, as a share of that: about 1 for plastic, 0
/// for tissue; None where the image does not show it.
pub fn section_contrast(
    frame: &impl Frame,
    section: &[Option<SectionDisc>; SECTION_DISCS],
) -> Option<f64> {
    let affine = Affine::new(GREEN_MINUS_RED, frame.format());
    let sample = |at: [f64; 2]| weighted_sum(frame, &affine, at);
    let mut inner = Mean::default();
    let mut sides = [Mean::default(); 2];
    for pair in section.windows(2) {
        let [Some(one), Some(next)] = pair else {
            continue;
        };
        let [u, v] = one.centre;
        let [du, dv] = [next.centre[0] - u, next.centre[1] - v];
        let length = du.hypot(dv).max(1e-6);
        for share in [-0.5, 0.0, 0.5] {
            let reach = share * one.radius / length;
            inner.add(sample([u - reach * dv, v + reach * du]));
        }
        for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
            for distance in BESIDE {
                let reach = sign * (one.radius + distance) / length;
                side.add(sample([u - reach * dv, v + reach * du]));
            }
        }
    }
    let tissue = sides.iter().filter_map(Mean::value).fold(0.0, f64::min);
    let inner = inner.value()?;
    (tissue < -LEAST_REDNESS).then_some(1.0 - inner / tissue)
}

fn along([u0, v0]: [f64; 2], [u1, v1]: [f64; 2], share: f64) -> [f64; 2] {
    [u0 + share * (u1 - u0), v0 + share * (v1 - v0)]
}

#[derive(Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: Option<f64>) {
        if let Some(value) = value {
            self.sum += value;
            self.count += 1.0;
        }
    }

    fn value(&self) -> Option<f64> {
        (self.count >= LEAST_SAMPLES).then_some(self.sum / self.count)
    }
}
