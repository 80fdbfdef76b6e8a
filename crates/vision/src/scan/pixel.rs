//! Weighted sums of single pixels, in any format.

use super::discriminant::Affine;
use super::frame::Frame;
use super::row::{Consumer, Group, Row};
use crate::math::floor;

/// Weighted sum of B, G, R of the pixel nearest to `[u, v]` (px); None outside the frame.
pub fn weighted_sum(frame: &impl Frame, affine: &Affine, [u, v]: [f64; 2]) -> Option<f64> {
    if !(u >= -0.5 && v >= -0.5) {
        return None;
    }
    let (column, row) = (floor(u + 0.5), floor(v + 0.5));
    if column >= frame.width() || row >= frame.height() {
        return None;
    }
    let columns = frame.format().whole_groups(column..column + 1);
    let pixel = column - columns.start;
    Row::of(frame, row, columns).feed(Pixel { affine, pixel })
}

struct Pixel<'a> {
    affine: &'a Affine,
    pixel: usize,
}

impl Consumer for Pixel<'_> {
    type Outcome = Option<f64>;

    fn consume<const P: usize, G: Group<P>>(
        self,
        mut groups: impl Iterator<Item = G>,
    ) -> Option<f64> {
        let group = groups.next()?;
        let Affine { weights, constant } = self.affine;
        let sum = |sum, (channel, weight): (usize, &f64)| {
            sum + weight * f64::from(group.channel(self.pixel, channel))
        };
        Some(weights.iter().enumerate().fold(*constant, sum))
    }
}
