//! Eqs. (9)-(11): the point of decision 0002 from its formula, and the interaction matrix from differences.

use std::f64::consts::PI;

use crate::article::state::StateEstimator;
use crate::math::linear::Vector;
use crate::model::camera::Pose;
use crate::model::features::FeatureModel;
use crate::model::instrument::Instrument;
use crate::model::settings::{CameraSettings, InstrumentSettings, PoseSettings};
use proptest::prelude::*;

use super::camera::{CENTRE, FOCAL, camera, distortions, formula};
use super::config;

const LENGTH: f64 = 0.0186;
const MARKERS: [f64; 2] = [0.005, 0.0125];
/// The guide is 4 cm before the camera and leans to its axis.
const TRANSLATION: Vector = [0.012, -0.008, 0.04];
const ROTATION: Vector = [0.2, -0.3, 0.5];

/// Radius and length of the bands, and a distortion.
pub type Shape = (f64, f64, [f64; 8]);

pub fn shapes() -> impl Strategy<Value = Shape> {
    let size = || prop_oneof![4 => 0.0005..0.003_f64, 1 => Just(0.0)];
    (size(), size(), distortions())
}

pub fn states() -> impl Strategy<Value = [f64; 3]> {
    (0.0..0.02_f64, -3.0..3.0_f64, -1.2..1.2_f64).prop_map(|(a, b, c)| [a, b, c])
}

pub fn instrument((radius, length, _): Shape) -> Instrument {
    Instrument::new(LENGTH, MARKERS[0], MARKERS[1], radius, length).unwrap()
}

pub fn model_at(shape: Shape, translation: Vector) -> FeatureModel {
    let pose = Pose::new(translation, ROTATION).unwrap();
    FeatureModel::new(instrument(shape), camera(shape.2), pose)
}

pub fn model(shape: Shape) -> FeatureModel {
    model_at(shape, TRANSLATION)
}

/// Centre and axis of both bands in the camera frame.
pub fn bands(shape: Shape, state: [f64; 3]) -> [(Vector, Vector); 2] {
    let pose = Pose::new(TRANSLATION, ROTATION).unwrap();
    let bands = instrument(shape).markers(state);
    bands.map(|band| (pose.transform(band.position), pose.rotate(band.axis)))
}

pub fn product(a: Vector, b: Vector) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

pub fn across([ax, ay, az]: Vector, [bx, by, bz]: Vector) -> Vector {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

/// Distance of the camera from an axis, and the unit vector towards it: t x (t x p), made as long as one.
pub fn towards_camera(p: Vector, t: Vector) -> (f64, Vector) {
    let side = across(t, across(t, p));
    let distance = product(side, side).sqrt();
    (distance, side.map(|value| value / distance))
}

/// The matrix S and the points m and e of decision 0002.
fn visible_point((p, t): (Vector, Vector), (r, l, _): Shape) -> Vector {
    let (distance, n) = towards_camera(p, t);
    let b = across(t, n);
    let lift = r * (PI / 4.0 + (PI.powi(2) / 8.0 - 1.0) * r / distance);
    let m = [0, 1, 2].map(|k| p[k] + lift * n[k]);
    let spread = |row: usize, column: usize| {
        l.powi(2) / 12.0 * t[row] * t[column]
            + r.powi(2) * (2.0 / 3.0 - PI.powi(2) / 16.0) * n[row] * n[column]
            + r.powi(2) / 3.0 * b[row] * b[column]
    };
    [0, 1, 2].map(|k| m[k] - 4.0 / m[2] * spread(k, 2))
}

/// Central differences of four features.
fn slope(before: Option<[f64; 4]>, after: Option<[f64; 4]>, step: f64) -> [f64; 4] {
    let (before, after) = (before.unwrap(), after.unwrap());
    [0, 1, 2, 3].map(|k| (after[k] - before[k]) / (2.0 * step))
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn features_are_the_images_of_the_points_of_the_formula(shape in shapes(), state in states()) {
        let Some(found) = model(shape).predict(state) else { return Ok(()) };
        let [a, b] = bands(shape, state).map(|band| formula(visible_point(band, shape), shape.2));
        for (found, expected) in found.features.iter().zip([a, b].concat()) {
            prop_assert!((found - expected).abs() <= 1e-8, "{} {}", found, expected);
        }
    }

    /// A column per DOF; step and tolerance in units in which a DOF moves the image by about as much.
    #[test]
    fn the_interaction_matrix_is_that_of_differences(shape in shapes(), state in states()) {
        let model = model(shape);
        for (dof, step) in [(0, 1e-7), (1, 1e-5), (2, 1e-5)] {
            let moved = |by: f64| {
                let mut state = state;
                state[dof] += by;
                model.predict(state).map(|found| found.features)
            };
            let (Some(found), Some(_), Some(_)) = (model.predict(state), moved(-step), moved(step))
            else { return Ok(()) };
            let expected = slope(moved(-step), moved(step), step);
            let size = expected.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
            for k in 0..4 {
                let error = found.columns[dof][k] - expected[k];
                prop_assert!(error.abs() <= 2e-6 * size, "{} of {:?}", error, expected);
            }
        }
    }

    /// Uneven curvature displaces the tip across the chord of the section and does not turn it, and so does a displaced
    /// guide; by how much is the integral of the angle that it adds along the section.
    #[test]
    fn uneven_curvature_displaces_the_tip(shape in shapes(), state in states()) {
        let [_, rotation, bend] = state;
        // The chord leaves the guide at half of the bend; its normal in the plane of the bend.
        let normal = bend / 2.0 + PI / 2.0;
        let side = [normal.sin() * rotation.cos(), normal.sin() * rotation.sin(), normal.cos()];
        let side = Pose::new([0.0; 3], ROTATION).unwrap().rotate(side);
        let step = 1e-7;
        let moved = |by: f64| {
            let place = [0, 1, 2].map(|k| TRANSLATION[k] + by * side[k]);
            model_at(shape, place).predict(state).map(|found| found.features)
        };
        let Some([found, u, v]) = model(shape).by_geometry(state) else { return Ok(()) };
        prop_assert_eq!((u, v), ([1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]));
        // The angle bend x of the section's share x becomes bend (x + unevenness (x^2 - x)).
        let parts = 2000;
        let length: f64 = (0..parts).map(|part| {
            let x = (f64::from(part) + 0.5) / f64::from(parts);
            LENGTH * bend * (x * x - x) * (bend * x - bend / 2.0).cos() / f64::from(parts)
        }).sum();
        let expected = slope(moved(-step), moved(step), step).map(|by| length * by);
        let size = expected.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
        for k in 0..4 {
            prop_assert!((found[k] - expected[k]).abs() <= 2e-6 * size, "{:?} {:?}", found, expected);
        }
    }

    /// Features of a corrected geometry, and derivatives of these by the state and by the geometry.
    #[test]
    fn geometry_moves_the_features_by_its_derivative(
        shape in shapes(), state in states(), unevenness in -0.5..0.5_f64, shift in prop::array::uniform2(-20.0..20.0_f64),
    ) {
        let [u, v] = shift;
        let here = [unevenness, u, v];
        let step = 1e-6;
        let at = |by: f64| model(shape).with_geometry([unevenness + by, u, v]).predict(state).map(|found| found.features);
        let corrected = model(shape).with_geometry(here);
        let (Some(found), Some([by, ..]), Some(_), Some(_)) =
            (corrected.predict(state), corrected.by_geometry(state), at(-step), at(step)) else { return Ok(()) };
        let expected = slope(at(-step), at(step), step);
        let bend = |by: f64| {
            let [q1, q2, q3] = state;
            corrected.predict([q1, q2, q3 + by]).map(|found| found.features)
        };
        prop_assume!(bend(-step).is_some() && bend(step).is_some());
        let columns = slope(bend(-step), bend(step), step);
        for k in 0..4 {
            prop_assert!((by[k] - expected[k]).abs() <= 1e-5 * (1.0 + expected[k].abs()), "{by:?} {expected:?}");
            let error = (found.columns[2][k] - columns[k]).abs();
            prop_assert!(error <= 1e-5 * (1.0 + columns[k].abs()), "{:?} {columns:?}", found.columns[2]);
        }
        let plain = model(shape).with_geometry([unevenness, 0.0, 0.0]).predict(state).unwrap().features;
        for (k, shift) in [u, v, u, v].into_iter().enumerate() {
            prop_assert!((found.features[k] - plain[k] - shift).abs() <= 1e-9);
        }
    }

    /// One step of Eq. (16) from a prediction a little off leads back to the state that the image shows.
    #[test]
    fn a_small_error_of_the_prediction_is_found(
        rotation in -3.0..3.0_f64, bend in 0.4..1.0_f64, error in prop::array::uniform3(-1.0..1.0_f64)
    ) {
        let model = model((0.0015, 0.003, [0.0; 8]));
        let truth = [0.005, rotation, bend];
        let away = [0, 1, 2].map(|k| truth[k] + 1e-5 * error[k]);
        let image = model.predict(truth).unwrap().features;
        let all = StateEstimator::new([1e9; 3]).unwrap();
        let found = all.estimate(away, &model.predict(away).unwrap(), image);
        for (found, truth) in found.state.iter().zip(truth) {
            prop_assert!((found - truth).abs() <= 1e-6, "{} {}", found, truth);
        }
    }
}

/// The generated states are in view, so that the properties above are about something.
#[test]
fn most_of_the_workspace_is_visible() {
    let model = model((0.0015, 0.003, [0.05; 8]));
    for bend in [-1.2, -0.4, 0.4, 1.2] {
        for rotation in [-3.0, 0.0, 1.5] {
            let state = [0.01, rotation, bend];
            assert!(model.predict(state).is_some() && model.by_geometry(state).is_some());
        }
    }
}

#[test]
fn settings_give_the_model_of_their_values() {
    let shape = (
        0.0015,
        0.003,
        [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08],
    );
    let instrument = InstrumentSettings {
        bending_length: LENGTH,
        marker_a: MARKERS[0],
        marker_b: MARKERS[1],
        diameter: 0.003,
        band_length: shape.1,
    };
    let camera = CameraSettings {
        fx: FOCAL[0],
        fy: FOCAL[1],
        cx: CENTRE[0],
        cy: CENTRE[1],
        distortion: shape.2,
        camera_from_guide: PoseSettings {
            translation: TRANSLATION,
            rotation: ROTATION,
        },
    };
    assert_eq!(
        FeatureModel::from_settings(&instrument, &camera).unwrap(),
        model(shape)
    );
}

/// Straight ahead, in the camera's frame: the axis is parallel to the optical axis, at a distance of `offset`.
fn ahead(radius: f64, offset: f64, distortion: [f64; 8]) -> FeatureModel {
    let pose = Pose::new([offset, 0.0, 0.04], [0.0; 3]).unwrap();
    FeatureModel::new(
        instrument((radius, 0.003, distortion)),
        camera(distortion),
        pose,
    )
}

/// The radius is a power of two, and therefore the distance is exactly the radius.
#[test]
fn from_within_the_extension_of_the_cylinder_nothing_is_visible() {
    let radius = 1.0 / 512.0;
    let straight = [0.01, 0.0, 0.0];
    for offset in [0.0, 0.5 * radius, radius] {
        assert!(ahead(radius, offset, [0.0; 8]).predict(straight).is_none());
        assert!(ahead(radius, offset, [0.0; 8]).bands(straight).is_none());
    }
    assert!(
        ahead(radius, 1.5 * radius, [0.0; 8])
            .predict(straight)
            .is_some()
    );
    assert!(
        ahead(radius, 1.5 * radius, [0.0; 8])
            .bands(straight)
            .is_some()
    );
}

#[test]
fn what_cannot_be_projected_is_not_predicted() {
    let straight = [0.01, 0.0, 0.0];
    let behind = [-0.2, 0.0, 0.0];
    // x (1 - 100 r2) folds beyond a radius of 0.058; the band is at 0.01 / 0.068.
    let folding = ahead(0.0015, 0.01, [-100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let plain = ahead(0.0015, 0.01, [0.0; 8]);
    assert!(plain.predict(straight).is_some() && plain.by_geometry(straight).is_some());
    for (model, state) in [
        (plain, behind),
        (plain, [f64::NAN, 0.0, 0.0]),
        (plain, [0.01, f64::INFINITY, 0.0]),
        (plain, [0.01, 0.0, f64::NAN]),
        (folding, straight),
    ] {
        assert!(model.predict(state).is_none(), "{state:?}");
        assert!(model.by_geometry(state).is_none(), "{state:?}");
        assert!(model.bands(state).is_none(), "{state:?}");
    }
}
