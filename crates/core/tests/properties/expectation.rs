//! Prediction of the bands in an image from a state prediction, with its covariance.

use crate::estimation::expectation::StatePriors;
use crate::model::camera::{Camera, Pose};
use crate::model::features::FeatureModel;
use crate::model::geometry_error::GeometryDeviation;
use crate::model::instrument::Instrument;
use proptest::prelude::*;

use super::config;

const DEVIATION: [f64; 3] = [2e-3, 0.1, 0.1];
const UNSEEN: [f64; 4] = [f64::INFINITY; 4];

fn model() -> FeatureModel {
    FeatureModel::new(
        Instrument::new(18.5e-3, 5e-3, 15e-3, 1.75e-3, 4e-3).unwrap(),
        Camera::new([424.0, 454.0], [349.6, 285.0], [0.0; 8]).unwrap(),
        Pose::new([9e-3, 7e-3, 8e-3], [0.29, -0.37, 0.0]).unwrap(),
    )
}

fn states() -> impl Strategy<Value = [f64; 3]> {
    (15e-3..35e-3, -1.5..1.5, 0.1..1.2).prop_map(|(q1, q2, q3)| [q1, q2, q3])
}

fn priors(states: &[[f64; 3]], model_deviation: f64) -> StatePriors<'_> {
    StatePriors {
        states,
        deviation: DEVIATION,
        model_deviation,
        geometry: GeometryDeviation::EXACT,
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn before_an_image_the_bands_are_where_the_belief_has_them(state in states()) {
        let expected = model().expect(&priors(&[state], 2.5), [0.0; 4], UNSEEN);
        let (expected, bands) = (expected.unwrap(), model().bands(state).unwrap());
        prop_assert_eq!(expected.bands, bands);
        let [[ua, va], [ub, vb]] = bands.map(|band| band.centroid);
        prop_assert_eq!(expected.features, [ua, va, ub, vb]);
    }

    #[test]
    fn as_sure_as_states_drawn_from_the_belief_are_alike(state in states(), direction in prop::array::uniform4(-1.0..1.0)) {
        // Along any direction: the spread of a linear function of independent DOFs, by differences.
        let expected = model().expect(&priors(&[state], 1e-9), [0.0; 4], UNSEEN).unwrap();
        let along = |state| -> f64 {
            let features = model().predict(state).unwrap().features;
            features.iter().zip(direction).map(|(feature, by)| feature * by).sum()
        };
        let mut variance = 0.0;
        for dof in 0..3 {
            let step = 1e-4 * DEVIATION[dof];
            let moved = |sign: f64| {
                let mut state = state;
                state[dof] += sign * step;
                along(state)
            };
            variance += ((moved(1.0) - moved(-1.0)) / 2e-4).powi(2);
        }
        let found: f64 = (0..4).flat_map(|i| (0..4).map(move |j| (i, j)))
            .map(|(i, j)| direction[i] * expected.covariance[i][j] * direction[j])
            .sum();
        prop_assert!((found - variance).abs() <= 1e-4 * variance + 1e-6, "{} {}", found, variance);
    }

    #[test]
    fn of_several_states_the_one_that_was_seen_is_found(state in states(), other in states()) {
        prop_assume!((state[1] - other[1]).abs() > 0.5);
        prop_assume!([state, other].into_iter().all(|state| model().bands(state).is_some()));
        let seen = model().predict(state).unwrap().features;
        let expected = model().expect(&priors(&[other, state], 2.5), seen, [0.1; 4]).unwrap();
        for (found, band) in expected.bands.iter().zip(model().bands(state).unwrap()) {
            let [du, dv] = [0, 1].map(|axis| found.centroid[axis] - band.centroid[axis]);
            prop_assert!(du.hypot(dv) < 0.5, "{} {}", du, dv);
        }
    }
}
