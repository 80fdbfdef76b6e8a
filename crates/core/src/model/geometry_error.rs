//! Errors of the features by a camera and bands that are not where they are configured.

use crate::dof::PerDof;
use crate::math::linear::{Vector, cross, dot, scale};
use crate::model::features::FeatureModel;

/// Standard deviations of camera and bands from where they are configured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometryDeviation {
    /// Of the camera along each axis (m).
    pub shift: f64,
    /// Of the camera about each axis (rad).
    pub turn: f64,
    /// Of each band along the tip (m).
    pub band: f64,
}

impl GeometryDeviation {
    /// All as configured.
    pub const EXACT: Self = Self {
        shift: 0.0,
        turn: 0.0,
        band: 0.0,
    };
}

/// Number of errors: of the camera along and about three axes, of both bands.
pub const ERRORS: usize = 8;

impl FeatureModel {
    /// The model with errors (8,) of its geometry, in standard deviations.
    pub(crate) fn displaced(
        &self,
        deviation: &GeometryDeviation,
        [x, y, z, about_x, about_y, about_z, a, b]: [f64; ERRORS],
    ) -> Self {
        self.moved(
            scale(deviation.shift, [x, y, z]),
            scale(deviation.turn, [about_x, about_y, about_z]),
            [deviation.band * a, deviation.band * b],
        )
    }

    /// Change (4,) of the features in px by one standard deviation of each error at a state (3,) [m, rad, rad], to first order.
    ///
    /// None where [`FeatureModel::predict`] is.
    pub(crate) fn by_displacement(
        &self,
        state: PerDof<f64>,
        deviation: &GeometryDeviation,
    ) -> Option<[[f64; 4]; ERRORS]> {
        let [(a, axis_a), (b, axis_b)] = self.axes(state);
        let [ua, va] = self.project(a)?.pixel_by_point;
        let [ub, vb] = self.project(b)?.pixel_by_point;
        let column = |by_a: Vector, by_b: Vector| {
            [dot(ua, by_a), dot(va, by_a), dot(ub, by_b), dot(vb, by_b)]
        };
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let shift = |axis| column(scale(deviation.shift, axis), scale(deviation.shift, axis));
        let turn = |axis| {
            let angle = scale(deviation.turn, axis);
            column(cross(angle, a), cross(angle, b))
        };
        Some([
            shift(x),
            shift(y),
            shift(z),
            turn(x),
            turn(y),
            turn(z),
            column(scale(deviation.band, axis_a), [0.0; 3]),
            column([0.0; 3], scale(deviation.band, axis_b)),
        ])
    }
}
