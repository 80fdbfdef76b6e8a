//! Regions and runs of a window of a frame.

use super::discriminant::ColorDiscriminant;
use super::frame::{Frame, Window};
use super::regions::{Labeller, Region};
use super::run_map::RunMap;
use super::segment::Segmenter;

/// Only the largest regions, this many, are kept: it bounds the time on a noisy frame.
pub const MAX_REGIONS: usize = 32;

/// Finds regions and runs of marker pixels, and keeps those of the last frame.
#[derive(Clone, Debug)]
pub struct Scanner {
    segmenters: Vec<Segmenter>,
    labeller: Labeller,
    minimum_area: u64,
    /// The marker pixels of the last [`find`](Self::find).
    pub map: RunMap,
    /// The regions, the largest first.
    pub regions: Vec<Region>,
}

impl Scanner {
    /// With the discriminants to choose from; regions below the minimum area (px) are dropped.
    pub fn new(discriminants: &[ColorDiscriminant], smoothing: usize, minimum_area: u64) -> Self {
        let segmenter = |discriminant: &ColorDiscriminant| Segmenter::new(*discriminant, smoothing);
        Self {
            segmenters: discriminants.iter().map(segmenter).collect(),
            labeller: Labeller::default(),
            minimum_area,
            map: RunMap::default(),
            regions: Vec::with_capacity(MAX_REGIONS),
        }
    }

    /// Finds regions and runs in a window by one of the discriminants.
    pub fn find(&mut self, frame: &impl Frame, window: Window, discriminant: usize) {
        self.regions.clear();
        let mut map = std::mem::take(&mut self.map);
        let window = window.within(frame);
        map.start(frame.width(), frame.height());
        map.end_rows(window.top);
        self.collect(frame, window, discriminant, Some(&mut map));
        map.end_rows(frame.height());
        self.map = map;
    }

    /// Finds the regions in windows by the first discriminant; each ends where its window does.
    pub fn find_regions(&mut self, frame: &impl Frame, windows: &[Window]) {
        self.regions.clear();
        for window in windows {
            self.collect(frame, *window, 0, None);
        }
    }

    fn collect(
        &mut self,
        frame: &impl Frame,
        window: Window,
        discriminant: usize,
        mut map: Option<&mut RunMap>,
    ) {
        let Self {
            segmenters,
            labeller,
            minimum_area,
            regions,
            ..
        } = self;
        let Some(segmenter) = segmenters.get_mut(discriminant) else {
            return;
        };
        let mut keep = |region: Region| {
            let index = regions.partition_point(|kept| kept.area >= region.area);
            if region.area >= *minimum_area && index < MAX_REGIONS {
                regions.truncate(MAX_REGIONS - 1);
                regions.insert(index, region);
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
}
