//! Least-squares fit of the intensity of both bands under blur.

use std::f64::consts::PI;

use super::equations::{BACKGROUND, DIFFERENCE, SIGMA, UNKNOWNS, normal_equations, residuals};
use super::fit::BlurFit;
use super::mask::Mask;
use super::patch::Patch;
use crate::math::{Square, apply, difference, floor, inverse, quadratic};
use crate::recognition::{BandPrediction, BandPredictor, Outline, extent};
use crate::scan::Frame;
use crate::settings::Settings;

/// Gauss-Newton steps; the outlines are drawn anew in each. The first half is on means of 2 x 2 pixels, then the frame is
/// read again.
const STEPS: usize = 16;
const COARSE: usize = 2;
/// A fit that explains less than this share of the variance after the trial steps is given up: it bounds the time.
const TRIAL_STEPS: usize = 4;
const LEAST_TRIAL_EXPLAINED: f64 = 0.3;
/// The fit has converged if no position moves by more than this (px), a fifth of its least standard deviation by default.
const CONVERGED: f64 = 0.05;
/// Largest step of a position (px) and of the blur (px): the linearisation holds for about one sigma.
const LARGEST_STEP: f64 = 2.5;
const LARGEST_SIGMA_STEP: f64 = 0.5;
/// Bounds of sigma (px): below, samples do not resolve the kernel, above, 3 sigma exceed its array.
const SIGMA_BOUNDS: [f64; 2] = [0.6, 8.0];
/// Start of the tissue's unevenness, relative to its colour; each step estimates it anew.
const TISSUE_UNEVENNESS: f64 = 0.05;
/// Standard deviation of the positions whose posture the outlines are drawn in (px): at the start, and else.
const START_STD: f64 = 3.0;
const STEP_STD: f64 = 0.5;
/// Correlation of the model's errors of the two bands, which are 12 mm apart: an error of the camera's pose moves both.
const MODEL_CORRELATION: f64 = 0.98;
/// Bounds of a band's brightness: the largest, and the least that its ratio to the other's is computed from (grey levels).
const LARGEST_BRIGHTNESS: f64 = 400.0;
const LEAST_BRIGHTNESS: f64 = 5.0;
/// Pixels nearer than this to an outline are not used for the tissue's colour (px): blur mixes them with the band's.
const BAND_MARGIN: f64 = 4.0;
/// Least side of the patch (px).
const LEAST_SIDE: usize = 8;

/// Fits the intensity, in memory that it keeps.
#[derive(Clone, Debug, Default)]
pub struct BlurFitter {
    patch: Patch,
    /// The masks where each coordinate is larger by [`DIFFERENCE`], and at the position itself.
    masks: [[Mask; 2]; 5],
    buffer: Mask,
}

impl BlurFitter {
    /// Fits positions, brightness and blur of both bands from positions `start` on.
    ///
    /// ```text
    /// green(x) = a_A (m_A * g_sigma)(x - d_A) + a_B (m_B * g_sigma)(x - d_B) + b + noise
    /// ```
    ///
    /// with m the coverage of a sample by an outline and g a normal density. Least squares by Gauss-Newton steps, with
    /// the prediction as prior of the positions, and priors of sigma and of the ratio of both brightnesses. The shapes of
    /// both outlines are those of the posture at the positions, so their derivatives, by differences of masks, contain
    /// the change of shape; the prior is linearised there anew in each step. A trial ends after
    /// a few steps. None if the fit does not converge or the bands are not visible.
    pub fn fit(
        &mut self,
        frame: &impl Frame,
        predictor: &impl BandPredictor,
        start: [f64; 4],
        is_trial: bool,
        all_settings: &Settings,
    ) -> Option<BlurFit> {
        let settings = &all_settings.blur;
        let mut position = start;
        let mut prediction = drawn(predictor, position, START_STD)?;
        let mut sensor_variance =
            self.read(frame, &prediction.outlines, settings.margin, COARSE)?;
        let (mut brightness, mut sigma) = ([0.0; 2], settings.sigma);
        let mut tissue_unevenness = TISSUE_UNEVENNESS;
        let mut result = None;
        for step in 0..if is_trial { TRIAL_STEPS + 1 } else { STEPS } {
            if step == STEPS / 2 {
                sensor_variance = self.read(frame, &prediction.outlines, settings.margin, 1)?;
            }
            let scaled_sigma = sigma / self.patch.step;
            prediction = self.draw_masks(predictor, position, scaled_sigma)?;
            let (patch, masks) = (&self.patch, &self.masks);
            let prior = inverse(correlated(&prediction, all_settings))?;
            let mean = f64::midpoint(brightness[0], brightness[1]);
            // Errors other than sensor noise are alike in neighbours: the area of the kernel counts as one sample.
            let area = 2.0 * PI * scaled_sigma.max(1.0).powi(2);
            let band = (settings.unevenness * mean).powi(2);
            let weight = |redness: f64| {
                let alike = band + (tissue_unevenness * redness).powi(2);
                1.0 / (sensor_variance + area * alike).max(1.0)
            };
            let (mut normal, mut right) = normal_equations(patch, masks, brightness, sigma, weight);
            let offset = difference(prediction.features, position);
            for (row, pull) in apply(&prior, offset).into_iter().enumerate() {
                right[row] += pull;
                for (entry, prior) in normal[row].iter_mut().zip(prior[row]) {
                    *entry += prior;
                }
            }
            let ratio = (settings.brightness_ratio_deviation * mean.max(LEAST_BRIGHTNESS)).powi(-2);
            for (i, j) in [(4, 5), (5, 4)] {
                normal[i][i] += ratio;
                normal[i][j] -= ratio;
            }
            let sigma_weight = settings.sigma_deviation.powi(-2);
            normal[SIGMA][SIGMA] += sigma_weight;
            right[SIGMA] += sigma_weight * (settings.sigma - sigma);
            // Regular even where a patch shows no tissue.
            (BACKGROUND..UNKNOWNS).for_each(|index| normal[index][index] += 1e-9);
            let covariance = inverse(normal)?;
            let found = apply(&covariance, right);
            let longest = found[..4].iter().fold(0.0_f64, |most, d| most.max(d.abs()));
            // Without brightness, in the first step, nothing is known of positions and sigma.
            if step > 0 {
                let share = (LARGEST_STEP / longest).min(1.0);
                for (value, by) in position.iter_mut().zip(found) {
                    *value += share * by;
                }
                sigma += found[SIGMA].clamp(-LARGEST_SIGMA_STEP, LARGEST_SIGMA_STEP);
            }
            brightness =
                [found[4], found[5]].map(|value: f64| value.clamp(0.0, LARGEST_BRIGHTNESS));
            sigma = sigma.clamp(SIGMA_BOUNDS[0], SIGMA_BOUNDS[1]);
            let left = residuals(patch, &masks[4], &found, brightness, sensor_variance);
            tissue_unevenness = left.tissue_unevenness.max(settings.unevenness);
            let offset = difference(prediction.features, position);
            let model_variance = settings.model_deviation * settings.model_deviation;
            result = Some(BlurFit {
                features: position,
                covariance: std::array::from_fn(|i| {
                    std::array::from_fn(|j| {
                        covariance[i][j] + if i == j { model_variance } else { 0.0 }
                    })
                }),
                brightness,
                explained: left.explained,
                residual: left.std,
                sigma,
                mahalanobis_squared: quadratic(&prior, offset),
                outlines: prediction.outlines,
            });
            if step == TRIAL_STEPS && left.explained < LEAST_TRIAL_EXPLAINED {
                return None;
            }
            if step > STEPS / 2 && longest < CONVERGED {
                break;
            }
        }
        result
    }

    /// Draws the blurred masks of the outlines at a position, and where each coordinate is larger by [`DIFFERENCE`], without
    /// what the section hides. Returns the prediction at the position.
    fn draw_masks(
        &mut self,
        predictor: &impl BandPredictor,
        position: [f64; 4],
        sigma: f64,
    ) -> Option<BandPrediction> {
        let section = predictor.section(position, [STEP_STD; 4]);
        let mut last = None;
        for (index, masks) in self.masks.iter_mut().enumerate() {
            let mut place = position;
            if let Some(coordinate) = place.get_mut(index) {
                *coordinate += DIFFERENCE;
            }
            let prediction = drawn(predictor, place, STEP_STD)?;
            for (band, (mask, outline)) in masks.iter_mut().zip(&prediction.outlines).enumerate() {
                mask.draw(outline, &self.patch);
                mask.hide(&section, band, &self.patch);
                mask.blur(sigma, self.patch.columns, &mut self.buffer);
            }
            last = Some(prediction);
        }
        last
    }

    /// Reads the pixels around the outlines; returns the variance of the sensor noise (grey levels squared).
    fn read(
        &mut self,
        frame: &impl Frame,
        outlines: &[Outline; 2],
        margin: f64,
        step: usize,
    ) -> Option<f64> {
        let range = |axis: usize, size: usize| {
            let [first, last] = extent(outlines, axis);
            floor(first - margin).min(size)..floor(last + margin + 1.0).min(size)
        };
        let (columns, rows) = (range(0, frame.width()), range(1, frame.height()));
        if columns.len() < LEAST_SIDE || rows.len() < LEAST_SIDE {
            return None;
        }
        self.patch.read(frame, columns, rows, step);
        let grown = outlines.map(|outline| outline.grown(BAND_MARGIN));
        self.patch.remove_tissue_colour(&grown);
        Some(self.patch.sensor_variance())
    }
}

/// The prediction with outlines in the posture that best explains a position (px, standard deviation `std`), moved there.
fn drawn(predictor: &impl BandPredictor, position: [f64; 4], std: f64) -> Option<BandPrediction> {
    let mut prediction = predictor.predict(position, [std; 4])?;
    prediction.outlines = prediction.outlines_at(position);
    Some(prediction)
}

/// The covariance of the predicted positions, with the model's errors of both bands correlated.
fn correlated(prediction: &BandPrediction, settings: &Settings) -> Square<4> {
    let shared = MODEL_CORRELATION * settings.model_deviation.powi(2);
    let mut covariance = prediction.covariance;
    for (row, column) in [(0, 2), (2, 0), (1, 3), (3, 1)] {
        covariance[row][column] += shared;
    }
    covariance
}
