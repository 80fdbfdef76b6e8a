//! Runs to regions: 8-connected components, their areas, centroids and bounding boxes.

use super::format::MAX_SIDE;
use crate::math::real_sum;

/// An 8-connected set of marker pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Region {
    /// Number of pixels (px).
    pub area: u64,
    /// Sum of the columns of its pixels (px).
    sum_u: u64,
    /// Sum of the rows of its pixels (px).
    sum_v: u64,
    /// First column of the bounding box (px).
    pub left: usize,
    /// First row of the bounding box (px).
    pub top: usize,
    /// Column after the bounding box (px).
    pub right: usize,
    /// Row after the bounding box (px).
    pub bottom: usize,
}

impl Region {
    fn of_run(v: usize, start: usize, end: usize) -> Self {
        let [length, first, row] = [end - start, start, v].map(|pixels| pixels as u64);
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

    fn merge(&mut self, other: &Self) {
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
        [self.sum_u, self.sum_v].map(|sum| real_sum(sum) / real_sum(self.area))
    }
}

/// Labels connected components of runs in one sweep from top to bottom, in memory that grows with the image's
/// width alone.
///
/// Union-find over labels (Rosenfeld and Pfaltz 1966, with runs instead of pixels): a run takes the label of the
/// runs it touches in the row above and joins their labels. Sums are kept per label, so no image of labels is stored.
/// A region that a row does not touch is finished, and its label is free (Bailey and Johnston 2007).
///
/// [`start`](Self::start), then for each row [`add`](Self::add) its runs and [`end_row`](Self::end_row);
/// a last, empty row ends the regions that touch the bottom.
#[derive(Clone, Debug, Default)]
pub struct Labeller {
    above: Vec<Run>,
    here: Vec<Run>,
    /// The first run in `above` that the next run may touch.
    cursor: usize,
    /// By label: the pixels of regions that touch the row above or begin in this one.
    parts: Vec<Part>,
    /// The same for the next row.
    next: Vec<Part>,
}

#[derive(Clone, Copy, Debug)]
struct Run {
    start: usize,
    end: usize,
    label: usize,
}

/// The pixels with one label.
#[derive(Clone, Copy, Debug)]
struct Part {
    region: Region,
    /// A label joined with this one; itself for the root.
    parent: usize,
    /// Its label in the next row, if it touches this one.
    relabelled: Option<usize>,
}

impl Part {
    fn new(label: usize, region: Region) -> Self {
        Self {
            region,
            parent: label,
            relabelled: None,
        }
    }
}

impl Labeller {
    /// Starts an image of this width; allocates only when the width grows.
    pub fn start(&mut self, width: usize) {
        let runs = width.div_ceil(2);
        for row in [&mut self.above, &mut self.here] {
            row.clear();
            row.reserve(runs);
        }
        for parts in [&mut self.parts, &mut self.next] {
            parts.clear();
            parts.reserve(2 * runs);
        }
        self.cursor = 0;
    }

    /// Adds a run of row `v`, `start < end <= MAX_SIDE`, to the right of the row's runs so far.
    pub fn add(&mut self, v: usize, start: usize, end: usize) {
        debug_assert!(start < end && end <= MAX_SIDE);
        let Self { above, parts, .. } = self;
        while above.get(self.cursor).is_some_and(|run| run.end < start) {
            self.cursor += 1;
        }
        let candidates = above.get(self.cursor..).unwrap_or_default();
        let touching = candidates.iter().take_while(|run| run.start <= end);
        let joined = touching
            .map(|run| run.label)
            .reduce(|one, other| join(parts, one, other));
        let region = Region::of_run(v, start, end);
        let label = if let Some(label) = joined {
            let label = root(parts, label);
            parts[label].region.merge(&region);
            label
        } else {
            parts.push(Part::new(parts.len(), region));
            parts.len() - 1
        };
        self.here.push(Run { start, end, label });
    }

    /// Ends a row and calls `finished` with the regions that do not touch it.
    #[inline]
    pub fn end_row(&mut self, finished: impl FnMut(Region)) {
        if !self.here.is_empty() || !self.parts.is_empty() {
            self.end_busy_row(finished);
        }
    }

    fn end_busy_row(&mut self, finished: impl FnMut(Region)) {
        if !self.labels_stay() {
            self.relabel(finished);
        }
        std::mem::swap(&mut self.above, &mut self.here);
        self.here.clear();
        self.cursor = 0;
    }

    /// Whether each label has exactly one run in this row, in their order: the common case, without relabelling.
    fn labels_stay(&self) -> bool {
        let mut labels = self.here.iter().zip(&self.parts).zip(0..);
        self.here.len() == self.parts.len()
            && labels.all(|((run, part), label)| run.label == label && part.parent == label)
    }

    fn relabel(&mut self, mut finished: impl FnMut(Region)) {
        let Self {
            here, parts, next, ..
        } = self;
        next.clear();
        for run in &mut *here {
            let root = root(parts, run.label);
            let part = &mut parts[root];
            run.label = *part.relabelled.get_or_insert_with(|| {
                next.push(Part::new(next.len(), part.region));
                next.len() - 1
            });
        }
        for (label, part) in parts.iter().enumerate() {
            if part.parent == label && part.relabelled.is_none() {
                finished(part.region);
            }
        }
        std::mem::swap(&mut self.parts, &mut self.next);
    }
}

/// The root of a label, with path halving. A label is always an index of `parts`.
fn root(parts: &mut [Part], mut label: usize) -> usize {
    while parts[label].parent != label {
        let grandparent = parts[parts[label].parent].parent;
        parts[label].parent = grandparent;
        label = grandparent;
    }
    label
}

/// Joins two labels; the root with the lower index becomes the root of both and is returned.
fn join(parts: &mut [Part], one: usize, other: usize) -> usize {
    let (one, other) = (root(parts, one), root(parts, other));
    let (first, second) = (one.min(other), one.max(other));
    if first != second {
        parts[second].parent = first;
        let region = parts[second].region;
        parts[first].region.merge(&region);
    }
    first
}
