//! Recurrent variation of a contact centre with the position of the tip.

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
        let (node, share) = self.place(position);
        let [left, right] = [node, node + 1].map(|node| self.nodes.get(node).copied());
        let left = left.unwrap_or(0.0);
        left + share * (right.unwrap_or(left) - left)
    }

    /// Moves the centre at a position by `change`, through the two nodes about it.
    pub fn add(&mut self, position: f64, change: f64) {
        let (place, share) = self.place(position);
        let norm = share * share + (1.0 - share) * (1.0 - share);
        for (node, weight) in [(place, 1.0 - share), (place + 1, share)] {
            if let Some(node) = self.nodes.get_mut(node) {
                *node += change * weight / norm;
            }
        }
    }

    /// The node below a position, and how far towards the next it is, 0 to 1.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        clippy::cast_sign_loss,
        reason = "0 to 16"
    )]
    fn place(&self, position: f64) -> (usize, f64) {
        let last = (NODES - 1) as f64;
        let place = ((position - self.start) / self.spacing).max(0.0).min(last);
        let node = place as usize;
        (node, place - node as f64)
    }
}
