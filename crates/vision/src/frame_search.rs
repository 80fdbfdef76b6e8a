//! Detection in one frame: where to search, and which of the results counts.

use crate::blur::{BlurFit, BlurFitter};
use crate::recognition::{
    BLOBS, BandPrediction, BandPredictor, BlobPostures, LEAST_CONTRAST, OutlineSearch,
    PostureTable, Recognition, SECTION_DISCS, SectionDisc, section_contrast,
};
use crate::scan::{Frame, Region, Scanner, Window};
use crate::settings::Settings;

/// Least sum of the edge shares of both bands for which the outlines are fitted again near them, without a prediction.
const LEAST_EDGES: f64 = 1.0;

/// Least coverage, and least share inside the image, of each band that is recognised in any pose: outlines of any shape fit a
/// piece of a band.
const CLEAR_COVERAGE: f64 = 0.5;
const CLEAR_INSIDE: f64 = 0.9;

/// Standard deviation of the positions whose posture the section is drawn in (px).
const SECTION_STD: [f64; 4] = [0.5; 4];

/// What a detector keeps between frames: memory, but no information.
#[derive(Clone, Debug)]
pub struct Memory {
    /// Regions and runs of the last scan.
    pub scanner: Scanner,
    /// Regions of the best result of the discriminants so far.
    pub best: Vec<Region>,
    /// Regions of the result in the whole frame.
    pub first: Vec<Region>,
    /// Regions of the result near the prediction.
    pub kept: Vec<Region>,
    /// Postures of bands that are one region of some discriminant.
    pub blobs: BlobPostures,
    /// Fit of the intensity.
    pub blur: BlurFitter,
}

impl Memory {
    /// Exchanges the regions of the last search and those that are kept.
    pub const fn swap_kept(&mut self) {
        std::mem::swap(&mut self.kept, &mut self.scanner.regions);
    }
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
    /// Recognises both bands in the whole frame if the trained discriminant shows them clearly.
    pub fn run_clear(mut self) -> Option<Recognition> {
        self.memory.blobs = [None; BLOBS];
        let found = self.by_discriminant(Window::whole(self.frame), 0);
        let is_clear = found.rejections == [None; 2]
            && found
                .scores
                .iter()
                .all(|score| score.coverage >= CLEAR_COVERAGE && score.inside >= CLEAR_INSIDE);
        is_clear.then_some(found)
    }

    /// Recognises the bands.
    pub fn run(mut self) -> Recognition {
        if self.predictor.is_located() {
            return self.near_prediction();
        }
        self.memory.blobs = [None; BLOBS];
        let found = self.by_edges(Window::whole(self.frame));
        if found.is_clear(self.settings) {
            found
        } else {
            self.again(&found)
        }
    }

    /// The better of the result in the window around the prediction and that by the edges in the whole frame.
    pub fn run_whole(mut self, found: &Recognition) -> Recognition {
        if self.window().is_some() {
            self.memory.swap_kept();
            let anywhere = self.by_edges(Window::whole(self.frame));
            if self.is_better(&anywhere, found) {
                return anywhere;
            }
            self.memory.swap_kept();
        }
        *found
    }

    /// The best of a result without a prediction that is not clear, of a search for edges near it, and of the intensity fit
    /// from the likeliest of the postures that the regions allow.
    fn again(&mut self, found: &Recognition) -> Recognition {
        let mut best = *found;
        let start = found.centroids();
        if found.scores[0].edges + found.scores[1].edges > LEAST_EDGES
            && let Some((predictor, window)) = self.near(start)
        {
            self.swap_first();
            let near = self.with(&predictor).by_edges(window);
            if self.is_better(&near, found) {
                best = near;
            } else {
                self.swap_first();
            }
            if best.is_clear(self.settings) {
                return best;
            }
        }
        let likeliest = if best.rejections == [None; 2] {
            Some(best.features)
        } else {
            self.likeliest_blurred(start)
        };
        let Some((predictor, window)) = likeliest.and_then(|start| self.near(start)) else {
            return best;
        };
        let mut search = self.with(&predictor);
        match predictor
            .predict([0.0; 4], [f64::INFINITY; 4])
            .and_then(|prior| search.by_intensity([prior.features; 2]))
        {
            Some(fit) => search.best_of(window, &best, &fit),
            None => best,
        }
    }

    /// The predictor with the posture at features `start` as prior, and the window around its bands.
    fn near(&self, start: [f64; 4]) -> Option<(P, Window)> {
        if !start.iter().all(|value| value.is_finite()) {
            return None;
        }
        let predictor = self.predictor.near(start)?;
        let prior = predictor.predict([0.0; 4], [f64::INFINITY; 4])?;
        let window = prior.window(self.frame, self.settings.search_margin)?;
        Some((predictor, window))
    }

    /// This search with another predictor.
    fn with<'b>(&'b mut self, predictor: &'b P) -> FrameSearch<'b, F, P> {
        FrameSearch {
            frame: self.frame,
            predictor,
            settings: self.settings,
            postures: self.postures,
            memory: &mut *self.memory,
        }
    }

    /// Features of the posture whose intensity and section explain the frame best, among `start` and those of both bands in
    /// one region.
    fn likeliest_blurred(&mut self, start: [f64; 4]) -> Option<[f64; 4]> {
        let mut best: Option<(f64, [f64; 4])> = None;
        let blobs = self.memory.blobs;
        let blobs = blobs.iter().flatten().map(|(_, features)| *features);
        for start in std::iter::once(start).chain(blobs) {
            let Some((predictor, _)) = self.near(start) else {
                continue;
            };
            let section = predictor.section(start, SECTION_STD);
            if self.contrast(&section) < 0.5 * LEAST_CONTRAST {
                continue;
            }
            let blur = &mut self.memory.blur;
            let Some(fit) = blur.fit(self.frame, &predictor, start, true, self.settings) else {
                continue;
            };
            let section = predictor.section(fit.features, SECTION_STD);
            let score = fit.explained + self.contrast(&section);
            if best.is_none_or(|(most, _)| score > most) {
                best = Some((score, fit.features));
            }
        }
        best.map(|(_, features)| features)
    }

    /// The prediction, and the window around it if that is small.
    fn window(&self) -> Option<(BandPrediction, Window)> {
        let prior = self.predictor.predict([0.0; 4], [f64::INFINITY; 4])?;
        let window = prior.window(self.frame, self.settings.search_margin)?;
        Some((prior, window))
    }

    /// Searches in the window around the prediction.
    fn near_prediction(&mut self) -> Recognition {
        let near = self.window();
        let whole = Window::whole(self.frame);
        let found = self.by_edges(near.map_or(whole, |(_, window)| window));
        if found.is_clear(self.settings) {
            return found;
        }
        // Intensity is less reliable than edges: it is used only near a known position.
        let Some((prior, window)) = near else {
            return found;
        };
        match self.by_intensity([found.centroids(), prior.features]) {
            Some(fit) => self.best_of(window, &found, &fit),
            None => found,
        }
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
        let mut blobs = self.memory.blobs;
        let found = self
            .outlines()
            .recognise(&self.memory.scanner.regions, &mut blobs);
        self.memory.blobs = blobs;
        found
    }

    /// An accepted fit of the intensity, from the first of the positions that leads to one.
    fn by_intensity(&mut self, starts: [[f64; 4]; 2]) -> Option<BlurFit> {
        let Memory { scanner, blur, .. } = &mut *self.memory;
        starts
            .into_iter()
            .filter(|start| start.iter().all(|value| value.is_finite()))
            .filter_map(|start| blur.fit(self.frame, self.predictor, start, false, self.settings))
            .find(|fit| {
                fit.is_accepted(self.settings)
                    && fit.is_inside(&scanner.map, self.settings)
                    && (!self.settings.is_unlocated || {
                        let section = self.predictor.section(fit.features, SECTION_STD);
                        section_contrast(self.frame, &section).unwrap_or_default() > LEAST_CONTRAST
                    })
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

    fn contrast(&self, section: &[Option<SectionDisc>; SECTION_DISCS]) -> f64 {
        section_contrast(self.frame, section).unwrap_or_default()
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
