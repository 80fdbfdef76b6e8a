//! The marker detector: Fig. 5 as a whole.

use crate::blur::{BlurFit, BlurFitter};
use crate::error::Error;
use crate::recognition::{BandPrediction, BandPredictor, OutlineSearch, Recognition};
use crate::scan::{ColorDiscriminant, Frame, Region, Scanner, Window};
use crate::settings::Settings;

/// Finds the two markers in frames. It keeps memory between frames, but no information.
#[derive(Clone, Debug)]
pub struct Detector {
    settings: Settings,
    unlocated: Settings,
    memory: Memory,
}

#[derive(Clone, Debug)]
struct Memory {
    scanner: Scanner,
    /// Regions of the best result so far.
    best: Vec<Region>,
    blur: BlurFitter,
}

/// Detection in one frame.
struct Search<'a, F, P> {
    frame: &'a F,
    predictor: &'a P,
    settings: &'a Settings,
    memory: &'a mut Memory,
}

impl Detector {
    /// Ready for the first frame.
    ///
    /// # Errors
    /// A setting is out of its range.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        let (smoothing, minimum_area) = (settings.smoothing, settings.minimum_area);
        if smoothing > 8 {
            return Err(Error::new("smoothing", &smoothing, "0 to 8 passes"));
        }
        if minimum_area < 1 {
            return Err(Error::new("minimum_area", &minimum_area, "at least 1 px"));
        }
        let mut discriminants = vec![ColorDiscriminant::new(
            settings.weights,
            settings.threshold,
        )?];
        for (weights, threshold) in &settings.alternatives {
            discriminants.push(ColorDiscriminant::new(*weights, *threshold)?);
        }
        let scanner = Scanner::new(&discriminants, smoothing, minimum_area);
        let best = Vec::with_capacity(scanner.regions.capacity());
        Ok(Self {
            unlocated: settings.unlocated(),
            settings,
            memory: Memory {
                scanner,
                best,
                blur: BlurFitter::default(),
            },
        })
    }

    /// Recognises the markers near their prediction: in the window around it, if that is small; there by a fit of the
    /// intensity, if the edges give no clear result; in the whole frame, if no band was found there.
    ///
    /// Returns the result and the regions it is based on, the largest first, at most
    /// [`MAX_REGIONS`](crate::MAX_REGIONS). Allocates only when a frame is larger than those before.
    pub fn recognise(
        &mut self,
        frame: &impl Frame,
        predictor: &impl BandPredictor,
    ) -> (Recognition, &[Region]) {
        let settings = if predictor.is_located() {
            &self.settings
        } else {
            &self.unlocated
        };
        let search = Search {
            frame,
            predictor,
            settings,
            memory: &mut self.memory,
        };
        (search.run(), &self.memory.scanner.regions)
    }

    /// The regions in windows, the largest first, at most [`MAX_REGIONS`](crate::MAX_REGIONS); each ends where its
    /// window does.
    ///
    /// Allocates only when a frame is larger than those before.
    pub fn regions_in(&mut self, frame: &impl Frame, windows: &[Window]) -> &[Region] {
        let scanner = &mut self.memory.scanner;
        scanner.find_regions(frame, windows);
        &scanner.regions
    }
}

impl<F: Frame, P: BandPredictor> Search<'_, F, P> {
    fn run(mut self) -> Recognition {
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
        one.quality(self.settings) > other.quality(self.settings)
    }

    /// The first clear result of the discriminants in turn, or the best.
    fn by_edges(&mut self, window: Window) -> Recognition {
        let mut found = self.by_discriminant(window, 0);
        for index in 1..self.memory.scanner.discriminants() {
            if found.is_clear(self.settings) {
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
                fit.is_accepted(self.settings) && fit.is_inside(&scanner.map, self.settings)
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

    fn outlines(&self) -> OutlineSearch<'_, P> {
        OutlineSearch {
            map: &self.memory.scanner.map,
            predictor: self.predictor,
            settings: self.settings,
        }
    }

    fn swap_regions(&mut self) {
        let Memory { scanner, best, .. } = &mut *self.memory;
        std::mem::swap(best, &mut scanner.regions);
    }
}
