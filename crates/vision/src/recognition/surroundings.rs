//! What is between the bands and beside them: between the bands of an instrument is the instrument, not tissue.

use super::outline::{OUTLINE_CORNERS, Outline, RIM};
use super::prediction::{SECTION_DISCS, SectionDisc};
use crate::scan::{Affine, Frame};

/// Weights of B, G, R for green minus red: about 0 for grey or black plastic, far below 0 for tissue, above 0 for a band.
const GREEN_MINUS_RED: [f64; 3] = [0.0, 1.0, -1.0];
/// Samples greener than this are a band's (grey levels).
const BAND: f64 = 8.0;
/// Tissue is at least this much redder than green (grey levels); what is less may be tissue or not.
const LEAST_REDNESS: f64 = 10.0;
/// By how much less red than the tissue beside it an instrument is at least, as a share of that: see [`section_contrast`].
pub const LEAST_CONTRAST: f64 = 0.4;
/// With fewer samples than this nothing is decided.
const LEAST_SAMPLES: f64 = 6.0;
/// Places of samples between the bands, as shares of the way from A to B, and beyond A.
const BETWEEN: [f64; 3] = [0.25, 0.5, 0.75];
const BEYOND: [f64; 3] = [-0.12, -0.2, -0.28];
/// Places of samples beside the instrument, and their distances from it (px).
const ALONG: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
const BESIDE: [f64; 3] = [4.0, 6.0, 8.0];

/// The contrast of what is between the bands and beyond band A, as [`section_contrast`].
///
/// Samples that are as green as a band are left out: letters of the bands' colour have more letters between them.
pub fn contrast_between(frame: &impl Frame, [a, b]: &[Outline; 2]) -> Option<f64> {
    let mut redness = Redness::of(frame);
    let facing = |index: usize| [a.corners[OUTLINE_CORNERS - 1 - index], b.corners[index]];
    for index in 2..RIM - 2 {
        let [near, far] = facing(index);
        let own = a.corners[index];
        let between = BETWEEN.map(|share| along(near, far, share));
        let beyond = BEYOND.map(|share| along(own, far, share));
        for at in between.into_iter().chain(beyond) {
            let sample = redness.sample(at).filter(|green| *green <= BAND);
            redness.inner.add(sample);
        }
    }
    for share in ALONG {
        let [one, other] = [0, RIM - 1].map(|index| {
            let [near, far] = facing(index);
            along(near, far, share)
        });
        let [du, dv] = [one[0] - other[0], one[1] - other[1]];
        let width = du.hypot(dv).max(1e-6);
        redness.beside([one, other], [du / width, dv / width], 0.0);
    }
    redness.contrast()
}

/// By how much less red the section next to the tip is than the tissue beside it, as a share of that: about 1 for plastic, 0
/// for tissue; None where the image does not show it.
///
/// Green minus red of tissue is negative and of plastic about 0, at any exposure.
///
/// Wrong where the instrument is as red as the tissue.
pub fn section_contrast(
    frame: &impl Frame,
    section: &[Option<SectionDisc>; SECTION_DISCS],
) -> Option<f64> {
    let mut redness = Redness::of(frame);
    for pair in section.windows(2) {
        let [Some(one), Some(next)] = pair else {
            continue;
        };
        let [u, v] = one.centre;
        let [du, dv] = [next.centre[0] - u, next.centre[1] - v];
        let length = du.hypot(dv).max(1e-6);
        let across = [-dv / length, du / length];
        for share in [-0.5, 0.0, 0.5] {
            let sample = redness.sample(beyond([u, v], across, share * one.radius));
            redness.inner.add(sample);
        }
        redness.beside([one.centre; 2], across, one.radius);
    }
    redness.contrast()
}

fn along([u0, v0]: [f64; 2], [u1, v1]: [f64; 2], share: f64) -> [f64; 2] {
    [u0 + share * (u1 - u0), v0 + share * (v1 - v0)]
}

fn beyond([u, v]: [f64; 2], [du, dv]: [f64; 2], distance: f64) -> [f64; 2] {
    [u + distance * du, v + distance * dv]
}

/// Samples of green minus red inside of what may be an instrument and on both sides of it.
struct Redness<'a, F> {
    frame: &'a F,
    affine: Affine,
    inner: Mean,
    sides: [Mean; 2],
}

impl<'a, F: Frame> Redness<'a, F> {
    fn of(frame: &'a F) -> Self {
        Self {
            frame,
            affine: Affine::new(GREEN_MINUS_RED, frame.format()),
            inner: Mean::default(),
            sides: [Mean::default(); 2],
        }
    }

    fn sample(&self, at: [f64; 2]) -> Option<f64> {
        self.affine.at(self.frame, at)
    }

    /// Samples both sides, beyond `ends` by a `radius` and more, along and against the unit vector `across`.
    fn beside(&mut self, ends: [[f64; 2]; 2], across: [f64; 2], radius: f64) {
        for (side, (end, sign)) in ends.into_iter().zip([1.0, -1.0]).enumerate() {
            for distance in BESIDE {
                let sample = self.sample(beyond(end, across, sign * (radius + distance)));
                self.sides[side].add(sample);
            }
        }
    }

    fn contrast(&self) -> Option<f64> {
        let tissue = (self.sides.iter().filter_map(Mean::value)).fold(0.0, f64::min);
        let inner = self.inner.value()?;
        (tissue < -LEAST_REDNESS).then_some(1.0 - inner / tissue)
    }
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
