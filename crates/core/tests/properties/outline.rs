//! The outline of a band from the points of its formula, its moments from triangles.

use crate::math::linear::Vector;
use crate::model::camera::{Camera, Pose};
use crate::model::features::FeatureModel;
use crate::model::outline::OUTLINE;
use proptest::prelude::*;

use super::camera::formula;
use super::config;
use super::features::{Shape, across, bands, instrument, model, shapes, states, towards_camera};

/// Points of an arc that is seen under +-acos(r / D), evenly spaced.
fn rim((p, t): (Vector, Vector), (r, l, _): Shape, end: f64) -> Vec<Vector> {
    let (distance, n) = towards_camera(p, t);
    let b = across(t, n);
    let horizon = (r / distance).acos();
    (-6..=6)
        .map(|part| {
            let (sin, cos) = (horizon * f64::from(part) / 6.0).sin_cos();
            [0, 1, 2].map(|k| p[k] + end * l / 2.0 * t[k] + r * (n[k] * cos + b[k] * sin))
        })
        .collect()
}

/// Integral over a polygon from triangles about `origin`; exact for polynomials up to the second degree.
fn integral(outline: &[[f64; 2]], origin: [f64; 2], f: impl Fn(f64, f64) -> f64) -> f64 {
    let middle = |a: [f64; 2], b: [f64; 2]| f(f64::midpoint(a[0], b[0]), f64::midpoint(a[1], b[1]));
    (0..outline.len())
        .map(|index| {
            let (a, b) = (outline[index], outline[(index + 1) % outline.len()]);
            let [[ax, ay], [bx, by]] = [a, b].map(|[x, y]| [x - origin[0], y - origin[1]]);
            let signed = (ax * by - ay * bx) / 2.0;
            signed * (middle(origin, a) + middle(a, b) + middle(b, origin)) / 3.0
        })
        .sum()
}

proptest! {
    #![proptest_config(config())]

    /// Once around: along the visible arc of the end nearer to the bend, and back along that of the other.
    #[test]
    fn corners_are_the_images_of_both_visible_arcs(shape in shapes(), state in states()) {
        let Some(found) = model(shape).bands(state) else { return Ok(()) };
        for (found, band) in found.iter().zip(bands(shape, state)) {
            let mut points = rim(band, shape, -1.0);
            points.extend(rim(band, shape, 1.0).into_iter().rev());
            prop_assert_eq!(points.len(), OUTLINE);
            for (corner, point) in found.outline.iter().zip(points) {
                let expected = formula(point, shape.2);
                prop_assert!((corner[0] - expected[0]).hypot(corner[1] - expected[1]) <= 1e-8);
            }
        }
    }

    #[test]
    fn area_and_moments_are_those_of_the_polygon(shape in shapes(), state in states()) {
        let Some(found) = model(shape).bands(state) else { return Ok(()) };
        for band in found {
            let (outline, [u, v]) = (band.outline, band.centroid);
            // About a corner in the middle, which is none where the sums start.
            let total = |f: &dyn Fn(f64, f64) -> f64| integral(&outline, outline[OUTLINE / 2], f);
            let area = total(&|_, _| 1.0);
            let extent = 1.0 + area.abs();
            prop_assert!((band.area - area.abs()).abs() <= 1e-9 * extent);
            prop_assert!(total(&|x, _| x - u).abs() <= 1e-7 * extent);
            prop_assert!(total(&|_, y| y - v).abs() <= 1e-7 * extent);
            let [uu, uv, vv] = band.moments;
            prop_assert!(total(&|x, _| (x - u).powi(2) - uu).abs() <= 1e-6 * extent * extent);
            prop_assert!(total(&|x, y| (x - u) * (y - v) - uv).abs() <= 1e-6 * extent * extent);
            prop_assert!(total(&|_, y| (y - v).powi(2) - vv).abs() <= 1e-6 * extent * extent);
        }
    }
}

#[test]
fn a_band_in_view_has_an_outline() {
    assert!(
        model((0.0015, 0.003, [0.0; 8]))
            .bands([0.01, 1.0, 0.5])
            .is_some()
    );
}

#[test]
fn nothing_and_too_much_have_no_area() {
    let state = [0.01, 1.0, 0.5];
    let line = model((0.0, 0.003, [0.0; 8]));
    assert!(line.predict(state).is_some() && line.bands(state).is_none());
    // Pixels are finite, their products are not.
    let huge = Camera::new([1e200; 2], [0.0; 2], [0.0; 8]).unwrap();
    let pose = Pose::new([0.0, 0.0, 0.04], [0.0; 3]).unwrap();
    let model = FeatureModel::new(instrument((0.0015, 0.003, [0.0; 8])), huge, pose);
    assert!(model.predict(state).is_some() && model.bands(state).is_none());
}
