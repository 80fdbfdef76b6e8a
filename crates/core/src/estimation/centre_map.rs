//! Recurrent variation of a contact centre with the position of the tip.

use core::array;

const NODES: usize = 17;

/// Centre of the contact offsets of one DOF over the position of the tip, piecewise linear; constant outside.
///
/// A shaft with a permanent curvature turns unevenly, for example. The map takes over what the ensemble finds again and
/// again at a position, so that the next pass starts from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentreMap {
    start: f64,
    spacing: f64,
    nodes: [f64; NODES],
}

impl CentreMap {
    /// Zero everywhere; 17 nodes `spacing` apart about `middle`, in the unit of the DOF.
    pub const fn new(middle: f64, spacing: f64) -> Self {
        Self {
            start: middle - 8.0 * spacing,
            spacing,
            nodes: [0.0; NODES],
        }
    }

    /// The centre at a position.
    pub fn at(&self, position: f64) -> f64 {
        let weights = self.weights(position);
        self.nodes
            .iter()
            .zip(weights)
            .map(|(node, w)| node * w)
            .sum()
    }

    /// Moves the centre at a position by `change`, and its neighbours by less.
    pub fn add(&mut self, position: f64, change: f64) {
        let weights = self.weights(position);
        let norm: f64 = weights.iter().map(|w| w * w).sum();
        for (node, weight) in self.nodes.iter_mut().zip(weights) {
            *node += change * weight / norm;
        }
    }

    /// Hat functions.
    #[expect(clippy::cast_precision_loss, reason = "at most 16")]
    fn weights(&self, position: f64) -> [f64; NODES] {
        let last = (NODES - 1) as f64;
        let place = ((position - self.start) / self.spacing).max(0.0).min(last);
        array::from_fn(|node| (1.0 - (place - node as f64).abs()).max(0.0))
    }
}
