//! Frame to markers: Fig. 5 as a whole.

use crate::blend::{Blend, Blended};
use crate::judge::{judge, judge_at};
use crate::verdict::Verdict;
use crate::{
    ColorDiscriminant, Demands, Error, Expect, Expectation, Frame, Labeller, Region, RunMap,
    Segmenter, Window,
};

/// Only so many regions, the largest, are considered: it bounds the time on a noisy frame.
pub const CANDIDATES: usize = 16;

/// What a [`Detector`] goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Which colours are marker.
    pub discriminant: ColorDiscriminant,
    /// Passes of the 3x3 binomial low-pass, 0 to 8.
    pub smoothing: usize,
    /// Regions below this are dropped (px), at least 1.
    pub minimum_area: u64,
}

/// Finds the two markers in frames. It carries memory from frame to frame, never information.
#[derive(Clone, Debug)]
pub struct Detector {
    settings: Settings,
    segmenter: Segmenter,
    labeller: Labeller,
    map: RunMap,
    regions: Vec<Region>,
    alternatives: Vec<Segmenter>,
    best: Vec<Region>,
    blend: Blend,
}

impl Detector {
    /// Ready for the first frame.
    ///
    /// # Errors
    /// A setting is out of its range.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        let Settings {
            smoothing,
            minimum_area,
            ..
        } = settings;
        if smoothing > 8 {
            return Err(Error::new("smoothing", &smoothing, "0 to 8 passes"));
        }
        if minimum_area < 1 {
            return Err(Error::new("minimum_area", &minimum_area, "at least 1 px"));
        }
        Ok(Self {
            settings,
            segmenter: Segmenter::new(settings.discriminant, smoothing),
            labeller: Labeller::default(),
            map: RunMap::default(),
            regions: Vec::with_capacity(CANDIDATES),
            alternatives: Vec::new(),
            best: Vec::with_capacity(CANDIDATES),
            blend: Blend::default(),
        })
    }

    /// Discriminants to try in turn where the first does not give a clear verdict.
    #[must_use]
    pub fn with_alternatives(mut self, discriminants: &[ColorDiscriminant]) -> Self {
        let segmenter = |one: &ColorDiscriminant| Segmenter::new(*one, self.settings.smoothing);
        self.alternatives = discriminants.iter().map(segmenter).collect();
        self
    }

    /// Recognises the markers by what `expect` says of them: in the window where they should be if
    /// that is small, there by their light if their edges are not clear, and in the whole frame if neither is there.
    ///
    /// Allocates only when a frame is larger than those before.
    pub fn recognise(
        &mut self,
        frame: &impl Frame,
        expect: &impl Expect,
        demands: &Demands,
    ) -> (Verdict, &[Region]) {
        let blind = expect.expect([0.0; 4], [f64::INFINITY; 4]);
        let near = blind.and_then(|blind| Some((blind, blind.window(frame)?)));
        let whole = Window::whole(frame);
        let window = near.map_or(whole, |(_, window)| window);
        let mut verdict = self.search(frame, window, expect, demands);
        if verdict.is_clear() {
            return (verdict, &self.regions);
        }
        // Light says less than edges: it is asked only where it is known where to look.
        if let Some((blind, window)) = near {
            if let Some(lit) = self.by_light(frame, expect, &blind, &verdict, demands) {
                verdict = self.weighed(frame, window, expect, demands, &verdict, &lit);
            }
            if verdict.reasons.iter().all(Option::is_some) {
                let anywhere = self.search(frame, whole, expect, demands);
                if anywhere.score() > verdict.score() {
                    verdict = anywhere;
                }
            }
        }
        (verdict, &self.regions)
    }

    /// The best verdict of all discriminants in a window, or the first that is clear.
    fn search(
        &mut self,
        frame: &impl Frame,
        window: Window,
        expect: &impl Expect,
        demands: &Demands,
    ) -> Verdict {
        self.find(frame, window);
        let mut verdict = judge(&self.regions, &self.map, expect, demands);
        for index in 0..self.alternatives.len() {
            if verdict.is_clear() {
                break;
            }
            std::mem::swap(&mut self.best, &mut self.regions);
            self.exchange(index);
            self.find(frame, window);
            self.exchange(index);
            let other = judge(&self.regions, &self.map, expect, demands);
            if other.score() > verdict.score() {
                verdict = Verdict {
                    discriminant: index + 1,
                    ..other
                };
            } else {
                std::mem::swap(&mut self.best, &mut self.regions);
            }
        }
        verdict
    }

    /// The best of a verdict that is not clear, what edges say where the light has the bands, and the light itself.
    fn weighed(
        &mut self,
        frame: &impl Frame,
        window: Window,
        expect: &impl Expect,
        demands: &Demands,
        verdict: &Verdict,
        lit: &Blended,
    ) -> Verdict {
        std::mem::swap(&mut self.best, &mut self.regions);
        self.find(frame, window);
        let again = judge_at(lit.features, [1.0; 4], &self.map, expect, demands);
        let edges = match again {
            Some(again) if again.score() > verdict.score() => again,
            _ => {
                std::mem::swap(&mut self.best, &mut self.regions);
                *verdict
            }
        };
        if edges.reasons != [None; 2] || lit.is_blurred() && !edges.is_clear() {
            lit.verdict()
        } else {
            edges
        }
    }

    /// The bands by their light, if that is good: from where the outlines were laid, or else from where they are expected.
    fn by_light(
        &mut self,
        frame: &impl Frame,
        expect: &impl Expect,
        blind: &Expectation,
        verdict: &Verdict,
        demands: &Demands,
    ) -> Option<Blended> {
        let [[ua, va], [ub, vb]] = verdict.bands.map(|band| band.centroid);
        let starts = [[ua, va, ub, vb], blind.features];
        let finite = starts
            .into_iter()
            .filter(|start| start.iter().all(|value| value.is_finite()));
        finite
            .filter_map(|start| self.blend.fit(frame, expect, blind, start))
            .find(|found| found.is_good(demands) && found.is_inside(&self.map, demands))
    }

    /// The regions in some windows, the largest first, at most [`CANDIDATES`]; each ends where its
    /// window does.
    ///
    /// Allocates only when a frame is larger than those before.
    pub fn regions_in(&mut self, frame: &impl Frame, windows: &[Window]) -> &[Region] {
        self.regions.clear();
        for window in windows {
            self.collect(frame, *window, None);
        }
        &self.regions
    }

    /// Regions and runs of one window.
    fn find(&mut self, frame: &impl Frame, window: Window) {
        self.regions.clear();
        let mut map = std::mem::take(&mut self.map);
        let window = window.within(frame);
        map.start(frame.width(), frame.height());
        map.end_rows(window.top);
        self.collect(frame, window, Some(&mut map));
        map.end_rows(frame.height());
        self.map = map;
    }

    fn collect(&mut self, frame: &impl Frame, window: Window, mut map: Option<&mut RunMap>) {
        let Self {
            segmenter,
            labeller,
            regions,
            settings,
            ..
        } = self;
        let mut keep = |region: Region| {
            let place = regions.partition_point(|kept| kept.area >= region.area);
            if region.area >= settings.minimum_area && place < CANDIDATES {
                regions.truncate(CANDIDATES - 1);
                regions.insert(place, region);
            }
        };
        labeller.start(frame.width());
        segmenter.each_row_in(frame, window, |v, runs| {
            if let Some(map) = &mut map {
                map.end_rows(v);
            }
            runs.each(|start, end| {
                labeller.add(v, start, end);
                if let Some(map) = &mut map {
                    map.add(start, end);
                }
            });
            labeller.end_row(&mut keep);
        });
        labeller.end_row(&mut keep);
    }

    fn exchange(&mut self, index: usize) {
        if let Some(other) = self.alternatives.get_mut(index) {
            std::mem::swap(&mut self.segmenter, other);
        }
    }
}
