//! Eq. (8): the projection from its formula, its Jacobian from differences, poses from quaternions.

use crate::math::linear::Vector;
use crate::model::camera::{Camera, Pose};
use proptest::prelude::*;

use super::{close, config};

pub const FOCAL: [f64; 2] = [600.0, 580.0];
pub const CENTRE: [f64; 2] = [380.0, 290.0];

pub fn distortions() -> impl Strategy<Value = [f64; 8]> {
    // k1, k2, p1, p2, k3, k4, k5, k6
    prop::array::uniform8(-0.1..0.1_f64)
}

fn points() -> impl Strategy<Value = Vector> {
    (-0.7..0.7, -0.7..0.7, 0.01..0.2).prop_map(|(x, y, depth)| [x * depth, y * depth, depth])
}

/// The formula of Eq. (8) with powers of the radius.
pub fn formula([across, down, depth]: Vector, distortion: [f64; 8]) -> [f64; 2] {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = distortion;
    let (x, y) = (across / depth, down / depth);
    let r = x.hypot(y);
    let sum = |a: f64, b: f64, c: f64| 1.0 + a * r.powi(2) + b * r.powi(4) + c * r.powi(6);
    let g = sum(k1, k2, k3) / sum(k4, k5, k6);
    let bent = [
        x * g + 2.0 * p1 * x * y + p2 * (r.powi(2) + 2.0 * x.powi(2)),
        y * g + p1 * (r.powi(2) + 2.0 * y.powi(2)) + 2.0 * p2 * x * y,
    ];
    [0, 1].map(|k| CENTRE[k] + FOCAL[k] * bent[k])
}

pub fn camera(distortion: [f64; 8]) -> Camera {
    Camera::new(FOCAL, CENTRE, distortion).unwrap()
}

/// Columns of the Jacobian of `formula`, by central differences.
fn differences(point: Vector, distortion: [f64; 8], step: f64) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|axis| {
        let (mut before, mut after) = (point, point);
        before[axis] -= step;
        after[axis] += step;
        let (before, after) = (formula(before, distortion), formula(after, distortion));
        [0, 1].map(|k| (after[k] - before[k]) / (2.0 * step))
    })
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_pixel_is_that_of_the_formula(point in points(), distortion in distortions()) {
        let found = camera(distortion).project(point).unwrap();
        for (found, expected) in found.pixel.iter().zip(formula(point, distortion)) {
            prop_assert!((found - expected).abs() <= 1e-9, "{} {}", found, expected);
        }
    }

    #[test]
    fn the_jacobian_is_that_of_differences(point in points(), distortion in distortions()) {
        let found = camera(distortion).project(point).unwrap();
        let expected = differences(point, distortion, 1e-5 * point[2]);
        for axis in 0..3 {
            for k in 0..2 {
                let error = found.pixel_by_point[k][axis] - expected[axis][k];
                prop_assert!((error * point[2]).abs() <= 1e-4, "{} of {:?}", error, expected);
            }
        }
    }

    /// Strong distortion, far outside the field: the map of (x, y) must neither mirror nor turn the image.
    #[test]
    fn a_fold_is_a_jacobian_that_mirrors_or_turns(
        x in -1.5..1.5_f64, y in -1.5..1.5_f64,
        distortion in prop::array::uniform8(-0.6..0.6_f64)
    ) {
        let point = [x, y, 1.0];
        let [by_x, by_y, _] = differences(point, distortion, 1e-6);
        let (a, b) = (by_x[0] / FOCAL[0], by_y[0] / FOCAL[0]);
        let (c, d) = (by_x[1] / FOCAL[1], by_y[1] / FOCAL[1]);
        let (determinant, trace) = (a * d - b * c, a + d);
        prop_assume!(determinant.abs() > 1e-3 && determinant < 1e3 && trace.abs() > 1e-3);
        let found = camera(distortion).project(point).unwrap();
        prop_assert_eq!(found.is_folded, determinant < 0.0 || trace < 0.0);
    }

    /// A unit quaternion (w, u) rotates v to v + 2 w (u x v) + 2 u x (u x v).
    #[test]
    fn a_pose_rotates_like_the_quaternion_and_then_translates(
        vector in prop::array::uniform3(-3.0..3.0_f64), size in prop_oneof![Just(1e-9), Just(1.0)],
        point in prop::array::uniform3(-2.0..2.0_f64), translation in prop::array::uniform3(-2.0..2.0_f64)
    ) {
        let vector = vector.map(|value| value * size);
        let angle = vector.iter().map(|value| value.powi(2)).sum::<f64>().sqrt();
        let u = vector.map(|value| value / angle * (angle / 2.0).sin());
        let w = (angle / 2.0).cos();
        let across = |[ax, ay, az]: Vector, [bx, by, bz]: Vector| {
            [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
        };
        let (once, twice) = (across(u, point), across(u, across(u, point)));
        let pose = Pose::new(translation, vector).unwrap();
        for k in 0..3 {
            let expected = point[k] + 2.0 * w * once[k] + 2.0 * twice[k];
            prop_assert!(close(pose.rotate(point)[k], expected));
            prop_assert!(close(pose.transform(point)[k], expected + translation[k]));
        }
    }
}

#[test]
fn without_a_rotation_a_pose_only_translates() {
    let pose = Pose::new([1.0, 2.0, 3.0], [0.0; 3]).unwrap();
    assert_eq!(pose.rotate([4.0, 5.0, 6.0]), [4.0, 5.0, 6.0]);
    assert_eq!(pose.transform([4.0, 5.0, 6.0]), [5.0, 7.0, 9.0]);
}

/// At (0, 1) with k2 = 2 and p1 = -3/2: dx'/dx = g + 2 p1 y = 0, dx'/dy = 0, dy'/dy = 2, all exact in binary.
#[test]
fn the_edge_of_a_fold_belongs_to_it() {
    let mut distortion = [0.0; 8];
    distortion[1] = 2.0;
    distortion[2] = -1.5;
    let found = camera(distortion).project([0.0, 1.0, 1.0]).unwrap();
    assert_eq!(found.pixel_by_point[0][0], 0.0);
    assert!(found.pixel_by_point[1][1] > 0.0 && found.is_folded);
}

/// With k4 = -10 the denominator is negative at a radius of 1/2: the image is turned by half a turn.
#[test]
fn an_image_turned_by_half_a_turn_is_folded() {
    let mut distortion = [0.0; 8];
    distortion[5] = -10.0;
    distortion[6] = 10.0;
    let (x, y) = (0.45, 0.1);
    let found = camera(distortion).project([x, y, 1.0]).unwrap();
    let [by_u, by_v] = found.pixel_by_point;
    let (u, v) = (by_u[0] / FOCAL[0], by_v[1] / FOCAL[1]);
    assert!(found.is_folded, "{u} {v}");
}

#[test]
fn what_is_not_in_front_of_the_camera_has_no_image() {
    let camera = camera([0.0; 8]);
    for depth in [0.0, -0.1, f64::NAN] {
        assert_eq!(camera.project([0.01, 0.02, depth]), None);
    }
    assert_eq!(camera.project([1e300, 0.0, 1e-300]), None, "overflow");
    let found = camera.project([0.01, 0.02, 0.1]).unwrap();
    assert!(close(found.pixel[0], 380.0 + 60.0) && close(found.pixel[1], 290.0 + 116.0));
}

#[test]
fn bad_values_are_named() {
    let field = |focal, centre, k| Camera::new(focal, centre, [k; 8]).unwrap_err().field;
    assert_eq!(field([0.0, 1.0], [0.0; 2], 0.0), "fx");
    assert_eq!(field([1.0, -1.0], [0.0; 2], 0.0), "fy");
    assert_eq!(field([1.0; 2], [f64::NAN, 0.0], 0.0), "cx");
    assert_eq!(field([1.0; 2], [0.0, f64::NAN], 0.0), "cy");
    assert_eq!(field([1.0; 2], [0.0; 2], f64::INFINITY), "distortion");
    assert_eq!(
        Pose::new([f64::NAN; 3], [0.0; 3]).unwrap_err().field,
        "translation"
    );
    assert_eq!(
        Pose::new([0.0; 3], [f64::NAN; 3]).unwrap_err().field,
        "rotation"
    );
}
