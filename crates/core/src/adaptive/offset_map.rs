//! The two contact offsets as functions of position, with their uncertainty.

mod prior;

use core::ops::Range;

pub use self::prior::OffsetPrior;
use crate::math::symmetric::Symmetric;

const NODES: usize = 33;
const TILT: usize = 2 * NODES;
const SIZE: usize = TILT + 1;
/// Entries of the covariance.
const ENTRIES: usize = SIZE * (SIZE + 1) / 2;
const MIDDLE: f64 = 16.0;

/// The tilt is kept between these, gains of 2 to 0.25, whatever was measured: with 1 + tilt at or below 0 no
/// command would put the tip anywhere.
pub(crate) const TILTS: (f64, f64) = (-0.5, 3.0);

/// Which of the two contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Of `delta_minus`.
    Minus,
    /// Of `delta_plus`.
    Plus,
}

impl Side {
    /// Minus, then plus.
    pub(crate) const BOTH: [Self; 2] = [Self::Minus, Self::Plus];

    const fn other(self) -> Self {
        match self {
            Self::Minus => Self::Plus,
            Self::Plus => Self::Minus,
        }
    }

    /// Its own of two values.
    pub(crate) const fn of(self, [minus, plus]: [f64; 2]) -> f64 {
        match self {
            Self::Minus => minus,
            Self::Plus => plus,
        }
    }
}

/// Both contact offsets over position: the tilt, and what is left of them at nodes, linear between
/// them, constant beyond the outermost; mean and joint covariance. A Kalman filter, one scalar
/// measurement at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct OffsetMap {
    prior: OffsetPrior,
    origin: f64,
    /// Of the nodes of `delta_minus`, then of `delta_plus`, then of the tilt.
    mean: [f64; SIZE],
    covariance: Symmetric<ENTRIES>,
    /// By distance in nodes, of the local part: exp(-distance / correlation).
    alike: [f64; NODES],
}

impl OffsetMap {
    /// A map that believes these offsets everywhere, as much as the prior says.
    // Without an allocator it has nowhere else to be.
    #[allow(clippy::large_stack_arrays)]
    pub fn new(prior: OffsetPrior, delta_minus: f64, delta_plus: f64) -> Self {
        let mut distance = -prior.spacing;
        let alike = [0.0; NODES].map(|_: f64| {
            distance += prior.spacing;
            libm::exp(-distance / prior.correlation)
        });
        let mut mean = [0.0; SIZE];
        for (index, value) in mean.iter_mut().take(TILT).enumerate() {
            *value = if index < NODES {
                delta_minus
            } else {
                delta_plus
            };
        }
        let mut map = Self {
            prior,
            origin: 0.0,
            mean,
            covariance: Symmetric::zero(),
            alike,
        };
        map.add(1.0, [prior.level, prior.tilt, prior.local]);
        map
    }

    /// The same map centred on another position: before anything is measured.
    pub const fn centre(&mut self, origin: f64) {
        self.origin = origin;
    }

    /// An offset at a position.
    pub fn offset(&self, side: Side, position: f64) -> f64 {
        self.node(side, position).pick(|index| self.at(index))
    }

    /// The tilt: mean, from -0.5 to 3, and standard deviation.
    pub fn tilt(&self) -> (f64, f64) {
        let variance = self.covariance.entry(TILT, TILT);
        (self.at(TILT), libm::sqrt(variance.max(0.0)))
    }

    /// The variance of an offset at a position.
    pub fn variance(&self, side: Side, position: f64) -> f64 {
        let node = self.node(side, position);
        let with = |index: usize| node.pick(|other| self.covariance.entry(index, other));
        let [first, second] = [node.below, node.below + 1].map(with);
        (first + node.share * (second - first) + node.away * with(TILT)).max(0.0)
    }

    /// The command has travelled so far: what is known grows old, up to what the prior says.
    pub fn travel(&mut self, distance: f64) {
        let prior = self.prior;
        let drift = [prior.level_drift, prior.tilt_drift, prior.local_drift];
        self.add(distance.abs(), drift);
        let variances = (0..TILT).map(|index| self.covariance.entry(index, index));
        let largest = libm::sqrt(variances.fold(0.0, f64::max));
        let most = libm::sqrt(prior.level * prior.level + prior.local * prior.local);
        self.shrink(0..TILT, most / largest);
        self.shrink(TILT..SIZE, prior.tilt / self.tilt().1);
    }

    /// Make some of what is estimated more certain by a factor, if below 1.
    fn shrink(&mut self, which: Range<usize>, factor: f64) {
        if factor < 1.0 {
            let own = |index| if which.contains(&index) { factor } else { 1.0 };
            self.covariance
                .update(|i, j, value| value * own(i) * own(j));
        }
    }

    /// An offset was measured at a position, with this variance, while a share of the width was there:
    /// the offset lay `(1 - share) / 2` of the width nearer to the other one.
    pub fn measure(&mut self, side: Side, position: f64, share: f64, offset: f64, variance: f64) {
        let nodes = [side, side.other()].map(|side| self.node(side, position));
        let nearer = (1.0 - share) / 2.0;
        let pick = |values: &dyn Fn(usize) -> f64| {
            let [own, other] = nodes.each_ref().map(|node| node.pick(values));
            own + nearer * (other - own)
        };
        let column: [f64; SIZE] =
            core::array::from_fn(|row| pick(&|index| self.covariance.entry(row, index)));
        let of = |index: usize| column.get(index).copied().unwrap_or(f64::NAN);
        let total = pick(&of) + variance;
        let surprise = offset - pick(&|index| self.at(index));
        self.shift(&column, surprise / total);
        self.covariance
            .update(|i, j, value| value - of(i) * of(j) / total);
    }

    /// An offset is at least so far out: the mean follows, and is as uncertain as before.
    ///
    /// It says nothing about the other contact, nor about the tilt that both share.
    pub fn bound(&mut self, side: Side, position: f64, offset: f64, variance: f64) {
        let node = self.node(side, position);
        let surprise = offset - node.pick(|index| self.at(index));
        // As if the tilt were known.
        let node = Node { away: 0.0, ..node };
        let mut column: [f64; SIZE] =
            core::array::from_fn(|row| node.pick(|index| self.covariance.entry(row, index)));
        for (index, value) in column.iter_mut().enumerate() {
            if index == TILT || (index < NODES) != (side == Side::Minus) {
                *value = 0.0;
            }
        }
        let total = node.pick(|index| column.get(index).copied().unwrap_or(f64::NAN)) + variance;
        self.shift(&column, surprise / total);
    }

    fn shift(&mut self, column: &[f64; SIZE], by: f64) {
        for (mean, gain) in self.mean.iter_mut().zip(column) {
            *mean += gain * by;
        }
        if let Some(tilt) = self.mean.get_mut(TILT) {
            *tilt = tilt.clamp(TILTS.0, TILTS.1);
        }
    }

    /// A mean; NaN beyond the last.
    fn at(&self, index: usize) -> f64 {
        self.mean.get(index).copied().unwrap_or(f64::NAN)
    }

    /// Add `share` of the variances of level, tilt and local part with these deviations.
    fn add(&mut self, share: f64, deviations: [f64; 3]) {
        let [level, tilt, local] = deviations.map(|deviation| share * deviation * deviation);
        let Self {
            prior,
            covariance,
            alike,
            ..
        } = self;
        covariance.update(|i, j, value| {
            value
                + match (i == TILT, j == TILT) {
                    (true, true) => tilt,
                    (false, false) if (i < NODES) == (j < NODES) => {
                        level + local * alike.get(i.abs_diff(j)).unwrap_or(&0.0)
                    }
                    (false, false) => -prior.symmetry * level,
                    _ => 0.0,
                }
        });
    }

    fn node(&self, side: Side, position: f64) -> Node {
        let place = (position - self.origin) / self.prior.spacing + MIDDLE;
        let place = place.clamp(0.0, 2.0 * MIDDLE);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let below = (place as usize).min(NODES - 2);
        #[allow(clippy::cast_precision_loss)]
        let share = place - below as f64;
        let first = if side == Side::Minus { 0 } else { NODES };
        Node {
            below: first + below,
            share,
            away: position - self.origin,
        }
    }
}

/// A place between two nodes.
struct Node {
    below: usize,
    share: f64,
    /// From where the map is centred.
    away: f64,
}

impl Node {
    fn pick(&self, values: impl Fn(usize) -> f64) -> f64 {
        let (a, b) = (values(self.below), values(self.below + 1));
        a + self.share * (b - a) + self.away * values(TILT)
    }
}
