//! The marker detector: Fig. 5 as a whole.

use std::sync::Arc;

use crate::error::Error;
use crate::frame_search::{Found, FrameSearch, Memory};
use crate::recognition::{BandPredictor, PostureTable, Recognition};
use crate::scan::{ColorDiscriminant, Frame, Region, Scanner, Window};
use crate::settings::Settings;

/// Finds the two markers in frames. It keeps memory between frames, but no information.
#[derive(Clone, Debug)]
pub struct Detector {
    settings: Settings,
    unlocated: Settings,
    postures: Arc<PostureTable>,
    memory: Memory,
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
        for (field, alternatives) in [
            ("alternatives", &settings.alternatives),
            ("unlocated.alternatives", &settings.unlocated.alternatives),
        ] {
            for (weights, threshold) in alternatives {
                let discriminant = ColorDiscriminant::new(*weights, *threshold);
                discriminants.push(discriminant.map_err(|error| Error { field, ..error })?);
            }
        }
        Ok(Self {
            unlocated: settings.unlocated(),
            settings,
            postures: Arc::default(),
            memory: Memory {
                scanner: Scanner::new(&discriminants, smoothing, minimum_area),
                ..Memory::default()
            },
        })
    }

    /// With postures that cover the workspace, which lead the search where the prior is of several postures.
    #[must_use]
    pub fn with_workspace(self, postures: Arc<PostureTable>) -> Self {
        Self { postures, ..self }
    }

    /// Recognises the markers.
    ///
    /// With a prediction, near it: in the window around it, if that is small; there by a fit of the intensity, if the edges
    /// give no clear result. Without one, in the whole frame, and again near what was found there, if that is not clear. If not
    /// both bands are found, geometry or prediction may be wrong: near the prediction, relying less on the geometry; then, relying
    /// on it even less, clear ones near the prediction, and anywhere; and if none is, with a prediction in the whole frame.
    ///
    /// Returns the result and the regions it is based on, the largest first, at most
    /// [`MAX_REGIONS`](crate::MAX_REGIONS). Allocates only when a frame is larger than those before.
    pub fn recognise(
        &mut self,
        frame: &impl Frame,
        predictor: &impl BandPredictor,
    ) -> (Recognition, &[Region]) {
        let found = self.find(frame, predictor);
        self.memory.scanner.regions = found.regions;
        (found.bands, self.memory.scanner.regions.as_slice())
    }

    fn find(&mut self, frame: &impl Frame, predictor: &impl BandPredictor) -> Found {
        let found = self.search(frame, predictor).run();
        if found.is_complete() {
            return found;
        }
        let is_located = predictor.is_located();
        if let Some(relaxed) = predictor.relaxed() {
            let near = is_located.then(|| self.search(frame, &relaxed).run());
            let again = near
                .filter(Found::is_complete)
                .or_else(|| {
                    let relaxed = relaxed.relaxed().filter(BandPredictor::is_located)?;
                    self.search(frame, &relaxed).run_clear()
                })
                .or_else(|| self.search(frame, &relaxed.anywhere()?).run_clear());
            if let Some(again) = again {
                return again;
            }
        }
        if is_located && found.bands.rejections.iter().all(Option::is_some) {
            return self.search(frame, predictor).run_whole(&found);
        }
        found
    }

    fn search<'a, F: Frame, P: BandPredictor>(
        &'a mut self,
        frame: &'a F,
        predictor: &'a P,
    ) -> FrameSearch<'a, F, P> {
        let settings = if predictor.is_located() {
            &self.settings
        } else {
            &self.unlocated
        };
        FrameSearch {
            frame,
            predictor,
            settings,
            postures: &self.postures,
            memory: &mut self.memory,
        }
    }

    /// The regions in windows, the largest first, at most [`MAX_REGIONS`](crate::MAX_REGIONS); each ends where its
    /// window does.
    ///
    /// Allocates only when a frame is larger than those before.
    pub fn regions_in(&mut self, frame: &impl Frame, windows: &[Window]) -> &[Region] {
        let scanner = &mut self.memory.scanner;
        scanner.find_regions(frame, windows);
        scanner.regions.as_slice()
    }
}
