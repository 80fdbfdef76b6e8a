//! A contact offset as a function of position, with its uncertainty.

use crate::error::{ConfigError, require_non_negative, require_positive};

const NODES: usize = 33;
const MIDDLE: f64 = 16.0;

/// What is known beforehand of how a contact offset varies; all in the unit of the DOF.
///
/// The offset at position y is a level, common to all positions, plus a local deviation that
/// is alike at neighbouring positions. Both are normal and wander as the command travels:
///
/// ```text
/// cov(delta(y), delta(y')) = level^2 + local^2 exp(-|y - y'| / correlation)
/// drift per travel d:        d (level_drift^2 + local_drift^2 exp(-|y - y'| / correlation))
/// ```
///
/// A change of the level is what a straightened scope does. What is local is a stretched cable, a
/// shaft that has taken a set, or one cable handing over to the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetPrior {
    /// Distance of two nodes; 33 of them, centred where the run starts, hold the function.
    pub spacing: f64,
    /// Standard deviation of the level before the first measurement, and the largest ever.
    pub level: f64,
    /// Standard deviation of the local part.
    pub local: f64,
    /// Distance over which the local part is alike.
    pub correlation: f64,
    /// Standard deviation of the level's change over a travel of 1, in the DOF's unit.
    pub level_drift: f64,
    /// The same of the local part.
    pub local_drift: f64,
}

impl OffsetPrior {
    /// The same, checked.
    ///
    /// # Errors
    /// A deviation is negative, a distance not above 0, or one of them is not finite.
    pub fn checked(self) -> Result<Self, ConfigError> {
        require_positive("spacing", self.spacing)?;
        require_positive("level", self.level)?;
        require_non_negative("local", self.local)?;
        require_positive("correlation", self.correlation)?;
        require_non_negative("level_drift", self.level_drift)?;
        require_non_negative("local_drift", self.local_drift)?;
        Ok(self)
    }

    fn covariance(&self, level: f64, local: f64, distance: f64) -> f64 {
        level * level + local * local * libm::exp(-distance * self.spacing / self.correlation)
    }
}

/// A contact offset over position: mean and covariance at nodes, linear between them, constant
/// beyond the outermost. A Kalman filter, one scalar measurement at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct OffsetMap {
    prior: OffsetPrior,
    origin: f64,
    mean: [f64; NODES],
    covariance: [[f64; NODES]; NODES],
    /// Of one unit of travel, by distance in nodes.
    drift: [f64; NODES],
}

impl OffsetMap {
    /// A map that believes `offset` everywhere, as much as the prior says, centred on `origin`.
    pub fn new(prior: OffsetPrior, offset: f64, origin: f64) -> Self {
        let at = |level, local| {
            let mut distance = -1.0;
            [0.0; NODES].map(|_: f64| {
                distance += 1.0;
                prior.covariance(level, local, distance)
            })
        };
        let row = at(prior.level, prior.local);
        let mut map = Self {
            prior,
            origin,
            mean: [offset; NODES],
            covariance: [[0.0; NODES]; NODES],
            drift: at(prior.level_drift, prior.local_drift),
        };
        map.add(&row, 1.0);
        map
    }

    /// The same map about another origin: before anything is measured.
    pub fn centre(&mut self, origin: f64) {
        self.origin = origin;
    }

    /// The offset at a position.
    pub fn offset(&self, position: f64) -> f64 {
        let node = self.node(position);
        node.pick(&self.mean)
    }

    /// The variance of the offset at a position.
    pub fn variance(&self, position: f64) -> f64 {
        let node = self.node(position);
        node.pick(&self.column(&node)).max(0.0)
    }

    /// The command has travelled so far: what is known grows old.
    pub fn travel(&mut self, distance: f64) {
        let drift = self.drift;
        self.add(&drift, distance.abs());
        let most = self
            .prior
            .covariance(self.prior.level, self.prior.local, 0.0);
        let largest = self
            .covariance
            .iter()
            .enumerate()
            .filter_map(|(index, row)| row.get(index))
            .fold(0.0, |a: f64, b| a.max(*b));
        if largest > most {
            let share = most / largest;
            for value in self.covariance.iter_mut().flatten() {
                *value *= share;
            }
        }
    }

    /// The offset was measured at a position, with this variance.
    pub fn measure(&mut self, position: f64, offset: f64, variance: f64) {
        let node = self.node(position);
        let column = self.column(&node);
        let total = self.shift(&node, &column, offset, variance);
        for (row, own) in self.covariance.iter_mut().zip(column) {
            for (value, other) in row.iter_mut().zip(column) {
                *value -= own * other / total;
            }
        }
    }

    /// The offset is at least so far out: the mean follows, and is as uncertain as before.
    pub fn bound(&mut self, position: f64, offset: f64, variance: f64) {
        let node = self.node(position);
        let column = self.column(&node);
        self.shift(&node, &column, offset, variance);
    }

    fn shift(&mut self, node: &Node, column: &[f64; NODES], offset: f64, variance: f64) -> f64 {
        let total = node.pick(column) + variance;
        let surprise = offset - node.pick(&self.mean);
        for (mean, gain) in self.mean.iter_mut().zip(column) {
            *mean += gain / total * surprise;
        }
        total
    }

    /// Covariance of every node with the offset at a place.
    fn column(&self, node: &Node) -> [f64; NODES] {
        let mut column = [0.0; NODES];
        for (value, row) in column.iter_mut().zip(&self.covariance) {
            *value = node.pick(row);
        }
        column
    }

    fn add(&mut self, by_distance: &[f64; NODES], share: f64) {
        for (i, row) in self.covariance.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value += share * by_distance.get(i.abs_diff(j)).unwrap_or(&0.0);
            }
        }
    }

    fn node(&self, position: f64) -> Node {
        let place = (position - self.origin) / self.prior.spacing + MIDDLE;
        let place = place.clamp(0.0, 2.0 * MIDDLE);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let below = (place as usize).min(NODES - 2);
        #[allow(clippy::cast_precision_loss)]
        let share = place - below as f64;
        Node { below, share }
    }
}

/// A place between two nodes.
struct Node {
    below: usize,
    share: f64,
}

impl Node {
    fn pick(&self, values: &[f64; NODES]) -> f64 {
        match values.get(self.below..self.below + 2) {
            Some([a, b]) => a + self.share * (b - a),
            _ => f64::NAN,
        }
    }
}
