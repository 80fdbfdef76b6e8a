//! Detection in one frame: where to search, and which of the results counts.

use crate::blur::{BlurFit, BlurFitter};
use crate::recognition::{
    BLOBS, BandPrediction, BandPredictor, BlobPostures, LEAST_CONTRAST, OutlineSearch,
    PostureTable, Recognition,
};
use crate::scan::{Frame, Regions, Scanner, Window};
use crate::settings::Settings;

/// Least sum of the edge shares of both bands for which the outlines are fitted again near them, without a prediction.
const LEAST_EDGES: f64 = 1.0;

/// Least coverage, and least share inside the image, of each band that is recognised in any pose: outlines of any shape fit a
/// piece of a band.
const CLEAR_COVERAGE: f64 = 0.5;
const CLEAR_INSIDE: f64 = 0.9;

/// What a detector keeps between frames: memory, but no information.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    /// Regions and runs of the last scan.
    pub scanner: Scanner,
    /// Postures of bands that are one region of some discriminant.
    pub blobs: BlobPostures,
    /// Fit of the intensity.
    pub blur: BlurFitter,
}

/// A result, and the regions that it is based on.
#[derive(Clone, Copy)]
pub struct Found {
    pub bands: Recognition,
    pub regions: Regions,
}

impl Found {
    /// Whether both bands are recognised.
    pub fn is_complete(&self) -> bool {
        self.bands.rejections == [None; 2]
    }

    fn or_better(self, other: Self, settings: &Settings) -> Self {
        if other.bands.is_better(&self.bands, settings) {
            other
        } else {
            self
        }
    }
}

/// Detection in one frame.
pub struct FrameSearch<'a, F, P> {
    pub frame: &'a F,
    pub predictor: &'a P,
    /// Settings for this kind of prediction.
    pub settings: &'a Settings,
    /// Postures that cover the workspace.
    pub postures: &'a PostureTable,
    pub memory: &'a mut Memory,
}

impl<F: Frame, P: BandPredictor> FrameSearch<'_, F, P> {
    /// Recognises both bands in the whole frame if the trained discriminant shows them clearly.
    pub fn run_clear(mut self) -> Option<Found> {
        let found = self.by_discriminant(Window::whole(self.frame), 0);
        let is_clear = found.is_complete()
            && (found.bands.scores.iter())
                .all(|score| score.coverage >= CLEAR_COVERAGE && score.inside >= CLEAR_INSIDE);
        is_clear.then_some(found)
    }

    /// Recognises the bands: in the window around the prediction, or without one in the whole frame, and again near what was
    /// found there.
    pub fn run(mut self) -> Found {
        let is_located = self.predictor.is_located();
        let near = is_located.then(|| self.window()).flatten();
        self.memory.blobs = [None; BLOBS];
        let whole = Window::whole(self.frame);
        let found = self.by_edges(near.map_or(whole, |(_, window)| window));
        if found.bands.is_clear(self.settings) {
            return found;
        }
        match near {
            // Intensity is less reliable than edges: it is used only near a known position.
            Some((prior, window)) => {
                self.by_intensity(window, &[found.bands.centroids(), prior.features], &found)
            }
            None if is_located => found,
            None => self.again(&found),
        }
    }

    /// The better of the result in the window around the prediction and that by the edges in the whole frame.
    pub fn run_whole(mut self, found: &Found) -> Found {
        if self.window().is_none() {
            return *found;
        }
        let anywhere = self.by_edges(Window::whole(self.frame));
        found.or_better(anywhere, self.settings)
    }

    /// The best of a result without a prediction that is not clear, of a search for edges near it, and of the intensity fit
    /// from the likeliest of the postures that the regions allow.
    fn again(&mut self, found: &Found) -> Found {
        let mut best = *found;
        let start = found.bands.centroids();
        let [a, b] = &found.bands.scores;
        if a.edges + b.edges > LEAST_EDGES
            && let Some((predictor, _, window)) = self.near(start)
        {
            let near = self.with(&predictor).by_edges(window);
            best = found.or_better(near, self.settings);
            if best.bands.is_clear(self.settings) {
                return best;
            }
        }
        let likeliest = if best.is_complete() {
            Some(best.bands.features)
        } else {
            self.likeliest_blurred(start)
        };
        match likeliest.and_then(|start| self.near(start)) {
            Some((predictor, prior, window)) => {
                let mut search = self.with(&predictor);
                search.by_intensity(window, &[prior.features], &best)
            }
            None => best,
        }
    }

    /// The predictor with the posture at features `start` as prior, its prediction, and the window around it.
    fn near(&mut self, start: [f64; 4]) -> Option<(P, BandPrediction, Window)> {
        if !start.iter().all(|value| value.is_finite()) {
            return None;
        }
        let predictor = self.predictor.near(start)?;
        let (prior, window) = self.with(&predictor).window()?;
        Some((predictor, prior, window))
    }

    /// This search with another predictor.
    fn with<'b>(&'b mut self, predictor: &'b P) -> FrameSearch<'b, F, P> {
        FrameSearch {
            predictor,
            memory: &mut *self.memory,
            ..*self
        }
    }

    /// Features of the posture whose intensity and section explain the frame best, among `start` and those of both bands in
    /// one region.
    fn likeliest_blurred(&mut self, start: [f64; 4]) -> Option<[f64; 4]> {
        let mut best: Option<(f64, [f64; 4])> = None;
        let blobs = self.memory.blobs.into_iter().flatten();
        let blobs = blobs.map(|(_, features)| features);
        for start in std::iter::once(start).chain(blobs) {
            let Some((predictor, ..)) = self.near(start) else {
                continue;
            };
            let mut search = self.with(&predictor);
            if search.contrast(start) < 0.5 * LEAST_CONTRAST {
                continue;
            }
            let Some(fit) = search.fit_intensity(start, true) else {
                continue;
            };
            let score = fit.explained + search.contrast(fit.features);
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

    /// The first certain result of the discriminants in turn, or the best.
    fn by_edges(&mut self, window: Window) -> Found {
        let mut found = self.by_discriminant(window, 0);
        for index in 1..=self.settings.alternatives.len() {
            if found.bands.is_certain(self.settings) {
                break;
            }
            found = found.or_better(self.by_discriminant(window, index), self.settings);
        }
        found
    }

    fn by_discriminant(&mut self, window: Window, discriminant: usize) -> Found {
        self.memory.scanner.find(self.frame, window, discriminant);
        let regions = self.memory.scanner.regions;
        let mut blobs = self.memory.blobs;
        let mut bands = self.outlines().recognise(regions.as_slice(), &mut blobs);
        bands.discriminant = discriminant;
        self.memory.blobs = blobs;
        Found { bands, regions }
    }

    /// The best of a result that is not clear, the first accepted fit of the intensity from one of the positions, and the edges
    /// near that.
    fn by_intensity(&mut self, window: Window, starts: &[[f64; 4]], found: &Found) -> Found {
        let finite = |start: &&[f64; 4]| start.iter().all(|value| value.is_finite());
        let fit = starts.iter().filter(finite).find_map(|start| {
            let fit = self.fit_intensity(*start, false)?;
            self.is_accepted(&fit).then_some(fit)
        });
        let Some(fit) = fit else {
            return *found;
        };
        self.memory.scanner.find(self.frame, window, 0);
        // The fit is accepted with about this standard deviation (px).
        let near = self.outlines().recognise_at(fit.features, [1.0; 4]);
        let edges = near.map_or(*found, |bands| {
            let regions = self.memory.scanner.regions;
            found.or_better(Found { bands, regions }, self.settings)
        });
        let is_blurred = fit.sigma > self.settings.blur.sharp_sigma;
        if edges.is_complete() && (!is_blurred || edges.bands.is_clear(self.settings)) {
            return edges;
        }
        Found {
            bands: fit.recognition(),
            ..edges
        }
    }

    fn fit_intensity(&mut self, start: [f64; 4], is_trial: bool) -> Option<BlurFit> {
        let blur = &mut self.memory.blur;
        blur.fit(self.frame, self.predictor, start, is_trial, self.settings)
    }

    fn is_accepted(&self, fit: &BlurFit) -> bool {
        fit.is_accepted(&self.memory.scanner.map, self.settings)
            && (!self.settings.is_unlocated || self.contrast(fit.features) > LEAST_CONTRAST)
    }

    fn contrast(&self, features: [f64; 4]) -> f64 {
        let contrast = self.outlines().section_contrast(features);
        contrast.unwrap_or_default()
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
}
