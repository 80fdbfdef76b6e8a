//! Errors of the features by a camera and bands that are not where they are configured.

use crate::dof::PerDof;
use crate::math::linear::{Vector, cross, dot, scale};
use crate::math::whitening::{Features, Square, Whitener, add_product};
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
const ERRORS: usize = 8;

/// Errors of the geometry at a state, as far as they move the bands in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeometryErrors {
    deviation: GeometryDeviation,
    /// Change (4,) of the features in px by one standard deviation of each error.
    columns: [Features; ERRORS],
}

impl GeometryErrors {
    /// Covariance (4, 4) in px^2 of the features:
    ///
    /// ```text
    /// G_mn = P_m (shift^2 I + turn^2 (p_m' p_n I - p_n p_m') + [m = n] band^2 t_m t_m') P_n'
    /// ```
    ///
    /// with the centre p, the axis t and the Jacobian P of the projection of bands m, n; to first order.
    pub(crate) fn covariance(&self) -> Square {
        let mut covariance = [[0.0; 4]; 4];
        for column in self.columns {
            add_product(&mut covariance, column);
        }
        covariance
    }

    /// The model with the most probable errors for an innovation that the whitener makes independent:
    ///
    /// ```text
    /// e = C' (W' W) (s - h),    C: the columns,  W (R + C C') W' = I
    /// ```
    pub(crate) fn explain(
        &self,
        model: &FeatureModel,
        whitener: &Whitener,
        innovation: Features,
    ) -> FeatureModel {
        let GeometryDeviation { shift, turn, band } = self.deviation;
        let whitened = whitener.apply(innovation);
        let error = |column: Features| {
            let terms = whitener.apply(column).into_iter().zip(whitened);
            terms.map(|(a, b)| a * b).sum::<f64>()
        };
        let [x, y, z, about_x, about_y, about_z, a, b] = self.columns.map(error);
        model.moved(
            scale(shift, [x, y, z]),
            scale(turn, [about_x, about_y, about_z]),
            [band * a, band * b],
        )
    }
}

impl FeatureModel {
    /// Errors of the geometry of these standard deviations at a state (3,) [m, rad, rad]. None where
    /// [`FeatureModel::predict`] is.
    pub(crate) fn geometry_errors(
        &self,
        state: PerDof<f64>,
        deviation: &GeometryDeviation,
    ) -> Option<GeometryErrors> {
        let [(a, axis_a), (b, axis_b)] = self.axes(state);
        let ([ua, va], [ub, vb]) = (self.pixel_by_point(a)?, self.pixel_by_point(b)?);
        let column = |by_a: Vector, by_b: Vector| {
            [dot(ua, by_a), dot(va, by_a), dot(ub, by_b), dot(vb, by_b)]
        };
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let shift = |axis| column(scale(deviation.shift, axis), scale(deviation.shift, axis));
        let turn = |axis| {
            let angle = scale(deviation.turn, axis);
            column(cross(angle, a), cross(angle, b))
        };
        let columns = [
            shift(x),
            shift(y),
            shift(z),
            turn(x),
            turn(y),
            turn(z),
            column(scale(deviation.band, axis_a), [0.0; 3]),
            column([0.0; 3], scale(deviation.band, axis_b)),
        ];
        Some(GeometryErrors {
            deviation: *deviation,
            columns,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::camera::{Camera, Pose};
    use crate::model::instrument::Instrument;

    fn model(translation: Vector, rotation: Vector, bands: [f64; 2]) -> FeatureModel {
        let [a, b] = bands;
        FeatureModel::new(
            Instrument::new(18.5e-3, a, b, 1.75e-3, 4e-3).unwrap(),
            Camera::new([520.0, 540.0], [360.0, 288.0], [0.0; 8]).unwrap(),
            Pose::new(translation, rotation).unwrap(),
        )
    }

    /// Two models whose geometry differs: the one explains what the other predicts, and better than without.
    #[test]
    fn errors_explain_the_features_of_another_geometry() {
        let told = model([5e-3, 4e-3, 12e-3], [0.1, -0.05, 0.3], [5e-3, 15e-3]);
        let actual = model([6e-3, 3e-3, 13e-3], [0.12, -0.03, 0.3], [5.2e-3, 14.8e-3]);
        let deviation = GeometryDeviation {
            shift: 1e-3,
            turn: 0.02,
            band: 0.3e-3,
        };
        for state in [[20e-3, 0.4, 1.2], [30e-3, -1.9, 0.4], [15e-3, 2.0, -0.8]] {
            let seen = actual.predict(state).unwrap().features;
            let errors = told.geometry_errors(state, &deviation).unwrap();
            let mut covariance = errors.covariance();
            for (index, row) in covariance.iter_mut().enumerate() {
                row[index] += 0.1;
            }
            let whitener = Whitener::new(&covariance, [true; 2]).unwrap();
            let away = |model: &FeatureModel| {
                let found = model.predict(state).unwrap().features;
                let squares = found.iter().zip(seen).map(|(a, b)| (a - b).powi(2));
                squares.sum::<f64>().sqrt()
            };
            let innovation: [f64; 4] =
                std::array::from_fn(|i| seen[i] - told.predict(state).unwrap().features[i]);
            let explained = errors.explain(&told, &whitener, innovation);
            assert!(
                away(&told) > 20.0 && away(&explained) < 0.1 * away(&told),
                "{state:?}"
            );
        }
    }

    /// The columns are the differences of the features of moved models; the centroid of a band and the image of its centre
    /// move nearly alike.
    #[test]
    fn columns_are_derivatives() {
        let at = model([5e-3, 4e-3, 12e-3], [0.1, -0.05, 0.3], [5e-3, 15e-3]);
        let deviation = GeometryDeviation {
            shift: 1e-5,
            turn: 1e-4,
            band: 1e-5,
        };
        let state = [20e-3, 0.4, 1.2];
        let errors = at.geometry_errors(state, &deviation).unwrap();
        for (index, column) in errors.columns.into_iter().enumerate() {
            let mut one = [0.0; ERRORS];
            one[index] = 1.0;
            let [x, y, z, about_x, about_y, about_z, a, b] = one;
            let moved = at.moved(
                scale(deviation.shift, [x, y, z]),
                scale(deviation.turn, [about_x, about_y, about_z]),
                [deviation.band * a, deviation.band * b],
            );
            let before = at.predict(state).unwrap().features;
            let after = moved.predict(state).unwrap().features;
            let size = column.iter().map(|value| value.abs()).fold(0.0, f64::max);
            for ((after, before), by) in after.into_iter().zip(before).zip(column) {
                assert!((after - before - by).abs() < 0.15 * size, "{index} {by}");
            }
        }
    }
}
