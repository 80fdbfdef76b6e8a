//! Detection in one frame: where to search, and which of the results counts.

use crate::blur::{BlurFit, BlurFitter};
use crate::recognition::{
    BandPrediction, BandPredictor, OutlineSearch, PostureTable, Recognition, is_instrument,
};
use crate::scan::{Frame, Region, Scanner, Window};
use crate::settings::Settings;

/// Least sum of the edge shares of both bands for which the outlines are fitted again near them, without a prediction.
const LEAST_EDGES: f64 = 1.0;

/// What a detector keeps between frames: memory, but no information.
#[derive(Clone, Debug)]
pub struct Memory {
    /// Regions and runs of the last scan.
    pub scanner: Scanner,
    /// Regions of the best result of the discriminants so far.
    pub best: Vec<Region>,
    /// Regions of the result in the whole frame.
    pub first: Vec<Region>,
    /// Fit of the intensity.
    pub blur: BlurFitter,
}

/// Detection in one frame.
pub struct FrameSearch<'a, F, P> {
    /// The frame.
    pub frame: &'a F,
    /// Prediction of the bands.
    pub predictor: &'a P,
    /// Settings for this kind of prediction.
    pub settings: &'a Settings,
    /// Postures that cover the workspace.
    pub postures: &'a PostureTable,
    /// Memory.
    pub memory: &'a mut Memory,
}

impl<F: Frame, P: BandPredictor> FrameSearch<'_, F, P> {
    /// Recognises the bands.
    pub fn run(mut self) -> Recognition {
        if self.predictor.is_located() {
            return self.near_prediction();
        }
        let found = self.by_edges(Window::whole(self.frame));
        if found.is_clear(self.settings) {
            found
        } else {
            self.again(&found)
        }
    }

    /// The best of a result without a prediction that is not clear, and of a search near it: the posture found there is the
    /// prior.
    fn again(&mut self, found: &Recognition) -> Recognition {
        let [[ua, va], [ub, vb]] = found.scores.map(|score| score.centroid);
        let start = [ua, va, ub, vb];
        if !start.iter().all(|value| value.is_finite()) {
            return *found;
        }
        let Some(predictor) = self.predictor.near(start) else {
            return *found;
        };
        let margin = self.settings.search_margin;
        let prior = predictor.predict([0.0; 4], [f64::INFINITY; 4]);
        let Some((prior, window)) =
            prior.and_then(|prior| Some((prior, prior.window(self.frame, margin)?)))
        else {
            return *found;
        };
        let mut search = FrameSearch {
            frame: self.frame,
            predictor: &predictor,
            settings: self.settings,
            postures: self.postures,
            memory: &mut *self.memory,
        };
        let mut best = *found;
        if found.scores[0].edges + found.scores[1].edges > LEAST_EDGES {
            search.swap_first();
            let near = search.by_edges(window);
            if search.is_better(&near, found) {
                best = near;
            } else {
                search.swap_first();
            }
            if best.is_clear(search.settings) {
                return best;
            }
        }
        match search.by_intensity(&prior, &best) {
            Some(fit) => search.best_of(window, &best, &fit),
            None => best,
        }
    }

    /// Searches in the window around the prediction first.
    fn near_prediction(&mut self) -> Recognition {
        let prior = self.predictor.predict([0.0; 4], [f64::INFINITY; 4]);
        let margin = self.settings.search_margin;
        let near = prior.and_then(|prior| Some((prior, prior.window(self.frame, margin)?)));
        let whole = Window::whole(self.frame);
        let mut found = self.by_edges(near.map_or(whole, |(_, window)| window));
        if found.is_clear(self.settings) {
            return found;
        }
        // Intensity is less reliable than edges: it is used only near a known position.
        if let Some((prior, window)) = near {
            if let Some(fit) = self.by_intensity(&prior, &found) {
                found = self.best_of(window, &found, &fit);
            }
            if found.rejections.iter().all(Option::is_some) {
                let anywhere = self.by_edges(whole);
                if self.is_better(&anywhere, &found) {
                    found = anywhere;
                }
            }
        }
        found
    }

    fn is_better(&self, one: &Recognition, other: &Recognition) -> bool {
        one.is_better(other, self.settings)
    }

    /// The first certain result of the discriminants in turn, or the best.
    fn by_edges(&mut self, window: Window) -> Recognition {
        let mut found = self.by_discriminant(window, 0);
        for index in 1..=self.settings.alternatives.len() {
            if found.is_certain(self.settings) {
                break;
            }
            self.swap_regions();
            let other = self.by_discriminant(window, index);
            if self.is_better(&other, &found) {
                found = Recognition {
                    discriminant: index,
                    ..other
                };
            } else {
                self.swap_regions();
            }
        }
        found
    }

    fn by_discriminant(&mut self, window: Window, index: usize) -> Recognition {
        self.memory.scanner.find(self.frame, window, index);
        self.outlines().recognise(&self.memory.scanner.regions)
    }

    /// An accepted fit of the intensity, from the outlines found so far or else from the prediction.
    fn by_intensity(&mut self, prior: &BandPrediction, found: &Recognition) -> Option<BlurFit> {
        let Memory { scanner, blur, .. } = &mut *self.memory;
        let [[ua, va], [ub, vb]] = found.scores.map(|score| score.centroid);
        let starts = [[ua, va, ub, vb], prior.features];
        starts
            .into_iter()
            .filter(|start| start.iter().all(|value| value.is_finite()))
            .filter_map(|start| {
                let settings = &self.settings.blur;
                blur.fit(self.frame, self.predictor, prior, start, settings)
            })
            .find(|fit| {
                fit.is_accepted(self.settings)
                    && fit.is_inside(&scanner.map, self.settings)
                    && (!self.settings.is_unlocated
                        || is_instrument(self.frame, &fit.outlines) == Some(true))
            })
    }

    /// The best of a result that is not clear, the edges near the intensity fit, and that fit itself.
    fn best_of(&mut self, window: Window, found: &Recognition, fit: &BlurFit) -> Recognition {
        self.swap_regions();
        self.memory.scanner.find(self.frame, window, 0);
        // The fit is accepted with about this standard deviation (px).
        let near = self.outlines().recognise_at(fit.features, [1.0; 4]);
        let edges = match near {
            Some(near) if self.is_better(&near, found) => near,
            _ => {
                self.swap_regions();
                *found
            }
        };
        if edges.rejections != [None; 2]
            || fit.is_blurred(&self.settings.blur) && !edges.is_clear(self.settings)
        {
            fit.recognition()
        } else {
            edges
        }
    }

    fn outlines(&self) -> OutlineSearch<'_, F, P> {
        OutlineSearch {
            frame: self.frame,
            map: &self.memory.scanner.map,
            predictor: self.predictor,
            settings: self.settings,
            postures: self.postures,
        }
    }

    fn swap_regions(&mut self) {
        let Memory { scanner, best, .. } = &mut *self.memory;
        std::mem::swap(best, &mut scanner.regions);
    }

    fn swap_first(&mut self) {
        let Memory { scanner, first, .. } = &mut *self.memory;
        std::mem::swap(first, &mut scanner.regions);
    }
}
