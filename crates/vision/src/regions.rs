//! Runs to regions: 8-connected components, their areas, centroids and bounding boxes.

use crate::frame::MAX_SIDE;

/// A set of marker pixels that touch each other along edges or at corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Number of pixels (px).
    pub area: u64,
    /// Sum of the columns of its pixels (px).
    pub sum_u: u64,
    /// Sum of the rows of its pixels (px).
    pub sum_v: u64,
    /// First column of the bounding box (px).
    pub left: usize,
    /// First row of the bounding box (px).
    pub top: usize,
    /// First column after the bounding box (px).
    pub right: usize,
    /// First row after the bounding box (px).
    pub bottom: usize,
}

impl Region {
    fn of_run(v: usize, start: usize, end: usize) -> Self {
        let (length, first, row) = (count(end - start), count(start), count(v));
        Self {
            area: length,
            sum_u: length * (2 * first + length - 1) / 2,
            sum_v: length * row,
            left: start,
            top: v,
            right: end,
            bottom: v + 1,
        }
    }

    fn absorb(&mut self, other: &Self) {
        self.area += other.area;
        self.sum_u += other.sum_u;
        self.sum_v += other.sum_v;
        self.left = self.left.min(other.left);
        self.top = self.top.min(other.top);
        self.right = self.right.max(other.right);
        self.bottom = self.bottom.max(other.bottom);
    }

    /// Mean of the pixels' centres `[u, v]` (px).
    pub fn centroid(&self) -> [f64; 2] {
        [self.sum_u, self.sum_v].map(|sum| real(sum) / real(self.area))
    }
}

/// Labels connected components from runs, in one sweep from the top to the bottom.
///
/// Union-find over the runs' labels (Rosenfeld and Pfaltz 1966, with runs in the place of pixels): a run takes
/// the label of what it touches in the row above and joins the labels it brings together. Each label gathers
/// its sums while the runs come in, so no image of labels is kept and the frame is not read again.
#[derive(Clone, Debug, Default)]
pub struct Labeller {
    above: Vec<Run>,
    here: Vec<Run>,
    /// Where in `above` the next run may first touch.
    cursor: usize,
    /// Of each label: a label joined with it and not later in order; itself, if it is the first.
    parents: Vec<usize>,
    /// Of each label: the pixels gathered under it and not yet handed to its parent.
    parts: Vec<Region>,
}

#[derive(Clone, Copy, Debug)]
struct Run {
    start: usize,
    end: usize,
    label: usize,
}

impl Labeller {
    /// Forgets the last image and makes room for the worst of this size, a lattice of single
    /// pixels; allocates only when the size grows.
    pub fn start(&mut self, width: usize, height: usize) {
        let (runs, labels) = (width.div_ceil(2), width.div_ceil(2) * height.div_ceil(2));
        for row in [&mut self.above, &mut self.here] {
            row.clear();
            row.reserve(runs);
        }
        self.parents.clear();
        self.parents.reserve(labels);
        self.parts.clear();
        self.parts.reserve(labels);
        self.cursor = 0;
    }

    /// Begins the next row.
    pub fn next_row(&mut self) {
        std::mem::swap(&mut self.above, &mut self.here);
        self.here.clear();
        self.cursor = 0;
    }

    /// Adds a run of row `v`, `start < end <= MAX_SIDE`, to the right of the row's runs so far.
    pub fn add(&mut self, v: usize, start: usize, end: usize) {
        debug_assert!(start < end && end <= MAX_SIDE);
        while self
            .above
            .get(self.cursor)
            .is_some_and(|run| run.end < start)
        {
            self.cursor += 1;
        }
        let mut label = None;
        let mut touching = self.cursor;
        while let Some(run) = self.above.get(touching).filter(|run| run.start <= end) {
            let theirs = run.label;
            label = Some(self.join(label.unwrap_or(theirs), theirs));
            touching += 1;
        }
        let part = Region::of_run(v, start, end);
        let label = if let Some(label) = label {
            self.parts[label].absorb(&part);
            label
        } else {
            self.parents.push(self.parents.len());
            self.parts.push(part);
            self.parents.len() - 1
        };
        self.here.push(Run { start, end, label });
    }

    /// The regions of at least `minimum_area` (px), in the order of their first pixels.
    pub fn regions(&self, minimum_area: u64) -> impl Iterator<Item = Region> {
        let labels = self.parents.iter().zip(&self.parts).enumerate();
        labels
            .filter(move |(label, (parent, part))| label == *parent && part.area >= minimum_area)
            .map(|(_, (_, part))| *part)
    }

    /// The first of the labels joined with this one. Labels come from `parents.len()`, so they index it.
    fn root(&mut self, mut label: usize) -> usize {
        while self.parents[label] != label {
            self.parents[label] = self.parents[self.parents[label]];
            label = self.parents[label];
        }
        label
    }

    fn join(&mut self, ours: usize, theirs: usize) -> usize {
        let (ours, theirs) = (self.root(ours), self.root(theirs));
        if ours == theirs {
            return ours;
        }
        let (first, second) = (ours.min(theirs), ours.max(theirs));
        self.parents[second] = first;
        let part = self.parts[second];
        self.parts[first].absorb(&part);
        first
    }
}

fn count(pixels: usize) -> u64 {
    pixels as u64
}

/// Exact: sums over a frame stay far below 2^53.
pub(crate) fn real(sum: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
    {
        sum as f64
    }
}
