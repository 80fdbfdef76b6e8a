//! Bands whose outlines are blurred away: their light instead of their edges.

use std::f64::consts::PI;

use crate::fit::settle;
use crate::layer::Layer;
use crate::linear::{Square, apply, inverse, quadratic};
use crate::numbers::whole;
use crate::patch::{Patch, SIDE};
use crate::samples::{Errors, Sums, UNKNOWNS, left, sums};
use crate::{Demands, Evidence, Expect, Expectation, Frame, Outline, RunMap, Verdict};

/// Steps to the best place.
const STEPS: usize = 16;
/// After so many, less than this share of the light explained is not worth the others.
const TRIAL: usize = 4;
const HOPELESS: f64 = 0.3;
/// Places that move by less than this are found (px).
const STILL: f64 = 0.05;
/// The longest of a place, in one step (px).
const STRIDE: f64 = 2.5;
/// Spread of the blur (px): where it starts, its own standard deviation, and its limits.
const SPREAD: f64 = 2.5;
const SPREAD_DEVIATION: f64 = 2.0;
const SPREADS: [f64; 2] = [0.6, 8.0];
/// The two bands are lit alike: standard deviation of the logarithm of their ratio.
const UNLIKE: f64 = 0.2;
/// Light is uneven by this share of a band's at least, and alike in neighbours.
const UNEVEN: f64 = 0.015;
/// What is found must explain this share of the light, be so many times brighter than what is left, its bands
/// be alike to this ratio, and its place be so sure (px): a marker that is 3 px off counts as wrong.
const EXPLAINED: f64 = 0.8;
const CLEARLY: f64 = 8.0;
const ALIKE: f64 = 0.6;
const SURE: f64 = 1.2;
/// Standard deviation for what is hidden and for what is not as the model has it (px).
const MODEL: f64 = 0.25;
/// Largest spread of the blur in a sharp frame (px).
const SHARP: f64 = 1.0;
/// Deviation of the tissue's colour relative to its redness, where it starts.
const MOTLEY: f64 = 0.05;
/// How far around the outlines light is looked at (px).
const AROUND: f64 = 14.0;

/// Two bands in place by their light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blended {
    /// Centroids `[u_A, v_A, u_B, v_B]` (px).
    pub features: [f64; 4],
    /// (4, 4) (px^2).
    pub covariance: Square<4>,
    /// How green each band is (grey levels).
    pub light: [f64; 2],
    /// Share of the variance of the light that is explained, but for the sensor's noise.
    pub explained: f64,
    /// Standard deviation of what is not (grey levels).
    pub noise: f64,
    /// Spread of the blur (px).
    pub spread: f64,
    /// Squared Mahalanobis distance of both bands from where they were expected.
    pub surprise: f64,
    /// The outlines in place.
    pub outlines: [Outline; 2],
}

impl Blended {
    /// Whether light like this is that of two bands, and says where they are.
    #[must_use]
    pub fn is_good(&self, demands: &Demands) -> bool {
        let [a, b] = self.light;
        let (least, most) = (a.min(b), a.max(b));
        self.explained >= EXPLAINED
            && least >= CLEARLY * self.noise
            && least >= ALIKE * most
            && self.surprise <= demands.surprise
            && (0..4).all(|index| self.covariance[index][index] <= SURE * SURE)
    }

    /// Whether enough of each band is in the image: light beyond the border is not seen.
    pub(crate) fn is_inside(&self, map: &RunMap, demands: &Demands) -> bool {
        let [a, b] = &self.outlines;
        let inside = |own: &Outline, other: &Outline| {
            own.count(map, other).pixels >= demands.inside * own.area
        };
        inside(a, b) && inside(b, a)
    }

    /// Whether the blur is more than what a frame that is sharp has.
    #[must_use]
    pub fn is_blurred(&self) -> bool {
        self.spread > SHARP
    }

    /// As a verdict. What the outlines' edges would have said is not asked: the share of the light takes its place.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        let [ua, va, ub, vb] = self.features;
        Verdict {
            features: self.features,
            covariance: self.covariance,
            bands: [[ua, va], [ub, vb]].map(|centroid| Evidence {
                edges: self.explained,
                bloom: self.spread,
                surprise: self.surprise,
                centroid,
                ..Evidence::default()
            }),
            reasons: [None; 2],
            discriminant: 0,
        }
    }
}

/// Memory for [`Blend::fit`].
#[derive(Clone, Debug)]
pub struct Blend {
    patch: Patch,
    layers: [Layer; 2],
    across: Vec<f32>,
}

impl Default for Blend {
    fn default() -> Self {
        Self {
            patch: Patch::default(),
            layers: [Layer::default(), Layer::default()],
            across: Vec::with_capacity(SIDE * SIDE),
        }
    }
}

impl Blend {
    /// Least squares for places, light and blur of both bands.
    ///
    /// ```text
    /// green(x) = a_A (m_A * g_sigma)(x - d_A) + a_B (m_B * g_sigma)(x - d_B) + b + noise
    /// ```
    ///
    /// with m the outlines' shares of a sample and g a normal density; Gauss-Newton, the outlines drawn anew at each
    /// step. Places keep to the expectation, and the light of both bands to each other.
    pub fn fit(
        &mut self,
        frame: &impl Frame,
        expect: &impl Expect,
        blind: &Expectation,
        start: [f64; 4],
    ) -> Option<Blended> {
        let prior = inverse(blind.covariance)?;
        let drawn = |place: [f64; 4], sure: f64| {
            let laid = expect.expect(place, [sure; 4])?;
            let [a, b] = &laid.bands;
            let [ua, va, ub, vb] = place;
            Some([settle(a, [ua, va]), settle(b, [ub, vb])])
        };
        let mut place = start;
        let mut outlines = drawn(place, 3.0)?;
        let mut grain = self.look(frame, &outlines)?;
        let (mut light, mut spread) = ([0.0; 2], SPREAD);
        let mut motley = MOTLEY;
        let mut result = None;
        for step in 0..STEPS {
            if step == STEPS / 2 {
                outlines = drawn(place, 1.0)?;
                grain = self.look(frame, &outlines)?;
            } else if step > 0 {
                outlines = drawn(place, 2.0)?;
            }
            for (layer, outline) in self.layers.iter_mut().zip(&outlines) {
                layer.draw(outline, &self.patch);
                layer.blur(
                    spread / self.patch.step,
                    self.patch.columns,
                    &mut self.across,
                );
            }
            // What is not noise of the sensor errs alike in neighbours: as many as the blur holds count as one.
            let brightness = f64::midpoint(light[0], light[1]);
            let errors = Errors {
                grain,
                alike: 4.0 * PI * (spread / self.patch.step).max(1.0).powi(2),
                uneven: UNEVEN * brightness,
                motley,
            };
            let Sums {
                mut normal,
                mut right,
            } = sums(&self.patch, &self.layers, light, spread, &errors);
            let away: [f64; 4] = std::array::from_fn(|i| blind.features[i] - place[i]);
            for (row, pull) in apply(&prior, away).into_iter().enumerate() {
                right[row] += pull;
                for (entry, prior) in normal[row].iter_mut().zip(prior[row]) {
                    *entry += prior;
                }
            }
            let alike = (UNLIKE * brightness.max(5.0)).powi(-2);
            for (i, j) in [(4, 5), (5, 4)] {
                normal[i][i] += alike;
                normal[i][j] -= alike;
            }
            let looseness = SPREAD_DEVIATION.powi(-2);
            normal[7][7] += looseness;
            right[7] += looseness * (SPREAD - spread);
            (6..UNKNOWNS).for_each(|index| normal[index][index] += 1e-9);
            let covariance = inverse(normal)?;
            let found = apply(&covariance, right);
            let longest = found[..4].iter().fold(0.0_f64, |most, d| most.max(d.abs()));
            // Without light there is no slope yet.
            let share = if step == 0 {
                0.0
            } else {
                (STRIDE / longest).min(1.0)
            };
            for (value, by) in place.iter_mut().zip(found) {
                *value += share * by;
            }
            light = [found[4], found[5]].map(|value: f64| value.clamp(0.0, 400.0));
            spread = (spread
                + if step == 0 {
                    0.0
                } else {
                    found[7].clamp(-0.5, 0.5)
                })
            .clamp(SPREADS[0], SPREADS[1]);
            let left = left(&self.patch, &self.layers, &found, light, grain);
            motley = left.motley;
            let away: [f64; 4] = std::array::from_fn(|i| blind.features[i] - place[i]);
            result = Some(Blended {
                features: place,
                covariance: std::array::from_fn(|i| {
                    std::array::from_fn(|j| {
                        covariance[i][j] + if i == j { MODEL * MODEL } else { 0.0 }
                    })
                }),
                light,
                explained: left.explained,
                noise: left.noise,
                spread,
                surprise: quadratic(&prior, away),
                outlines,
            });
            if step == TRIAL && left.explained < HOPELESS {
                return None;
            }
            if step > STEPS / 2 && longest < STILL {
                break;
            }
        }
        result
    }

    /// Reads the part of the frame around the outlines.
    fn look(&mut self, frame: &impl Frame, outlines: &[Outline; 2]) -> Option<f64> {
        let corners = || outlines.iter().flat_map(|outline| &outline.corners);
        let bound = |axis: usize, size: usize| {
            let values = || corners().map(|corner| corner[axis]);
            let first = values().fold(f64::INFINITY, f64::min) - AROUND;
            let last = values().fold(f64::NEG_INFINITY, f64::max) + AROUND;
            whole(first).min(size)..whole(last + 1.0).min(size)
        };
        let (columns, rows) = (bound(0, frame.width()), bound(1, frame.height()));
        if columns.len() < 8 || rows.len() < 8 {
            return None;
        }
        self.patch.read(frame, columns, rows);
        let grown = outlines.map(|outline| outline.grown(4.0));
        self.patch.unmix(&grown);
        Some(self.patch.grain())
    }
}
