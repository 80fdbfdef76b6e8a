//! Regions and runs of a window of a frame.

use super::discriminant::ColorDiscriminant;
use super::frame::{Frame, Window};
use super::regions::{Labeller, Region};
use super::run_map::RunMap;
use super::segment::Segmenter;

/// Only the largest regions, this many, are kept: it bounds the time on a noisy frame.
pub const MAX_REGIONS: usize = 32;

/// The largest regions of a scan, the largest first.
#[derive(Clone, Copy, Debug, Default)]
pub struct Regions {
    kept: [Region; MAX_REGIONS],
    count: usize,
}

impl Regions {
    pub fn as_slice(&self) -> &[Region] {
        self.kept.get(..self.count).unwrap_or_default()
    }

    fn keep(&mut self, region: Region) {
        let larger = |kept: &Region| kept.area >= region.area;
        let index = self.as_slice().partition_point(larger);
        self.count = MAX_REGIONS.min(self.count + 1);
        if let Some(smaller @ [_, ..]) = self.kept.get_mut(index..self.count) {
            smaller.rotate_right(1);
            smaller[0] = region;
        }
    }
}

/// Finds regions and runs of marker pixels, and keeps those of the last frame.
#[derive(Clone, Debug, Default)]
pub struct Scanner {
    segmenters: Vec<Segmenter>,
    labeller: Labeller,
    minimum_area: u64,
    /// The marker pixels of the last [`find`](Self::find).
    pub map: RunMap,
    pub regions: Regions,
}

impl Scanner {
    /// With the discriminants to choose from; regions below the minimum area (px) are dropped.
    pub fn new(discriminants: &[ColorDiscriminant], smoothing: usize, minimum_area: u64) -> Self {
        let segmenter = |discriminant: &ColorDiscriminant| Segmenter::new(*discriminant, smoothing);
        Self {
            segmenters: discriminants.iter().map(segmenter).collect(),
            minimum_area,
            ..Self::default()
        }
    }

    /// Finds regions and runs in a window by one of the discriminants.
    pub fn find(&mut self, frame: &impl Frame, window: Window, discriminant: usize) {
        self.regions = Regions::default();
        self.map.start(frame.width(), frame.height());
        self.collect(frame, window, discriminant, true);
        self.map.end_rows(frame.height());
    }

    /// Finds the regions in windows by the first discriminant; each ends where its window does.
    pub fn find_regions(&mut self, frame: &impl Frame, windows: &[Window]) {
        self.regions = Regions::default();
        for window in windows {
            self.collect(frame, *window, 0, false);
        }
    }

    fn collect(
        &mut self,
        frame: &impl Frame,
        window: Window,
        discriminant: usize,
        is_mapped: bool,
    ) {
        let Some(segmenter) = self.segmenters.get_mut(discriminant) else {
            return;
        };
        let mut keep = |region: Region| {
            if region.area >= self.minimum_area {
                self.regions.keep(region);
            }
        };
        self.labeller.start(frame.width());
        segmenter.each_row_in(frame, window, |v, runs| {
            runs.each(|start, end| {
                self.labeller.add(v, start, end);
                if is_mapped {
                    self.map.add(v, start, end);
                }
            });
            self.labeller.end_row(&mut keep);
        });
        self.labeller.end_row(&mut keep);
    }
}
