//! The weighted state estimate takes anything. What it should be is among Python's tests.

use crate::article::state::StateEstimator;
use crate::estimation::posture::Belief;
use crate::estimation::settings::StateEstimationSettings;
use crate::estimation::weighted::WeightedEstimator;
use crate::model::camera::{Camera, Pose};
use crate::model::features::FeatureModel;
use crate::model::instrument::Instrument;
use proptest::prelude::*;

use super::config;

const SETTINGS: StateEstimationSettings = StateEstimationSettings {
    marker_deviation: 0.3,
    model_deviation: 0.3,
    sideways_deviation: 0.3e-3,
    outlier_distance: 4.0,
    rest_deviation: 0.0,
    settling_time: 0.0,
    steps: 12,
};

fn model() -> FeatureModel {
    FeatureModel::new(
        Instrument::new(18.5e-3, 5e-3, 15e-3, 1.75e-3, 4e-3).unwrap(),
        Camera::new([424.0, 454.0], [349.6, 285.0], [0.0; 8]).unwrap(),
        Pose::new([9e-3, 7e-3, 8e-3], [0.29, -0.37, 0.0]).unwrap(),
    )
}

fn estimator(settings: StateEstimationSettings) -> WeightedEstimator {
    let watch = StateEstimator::new([2e-3, 0.1, 0.1]).unwrap();
    WeightedEstimator::new(watch, settings).unwrap()
}

fn anything() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -1000.0..1000.0,
        1 => prop::num::f64::ANY,
    ]
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn it_is_finite_or_nothing_whatever_comes(
        insertion in -0.1..0.2, rotation in -10.0..10.0, bending in -4.0..4.0,
        deviation in prop::array::uniform3(1e-6..10.0),
        measured in prop::array::uniform4(anything()),
        covariance in prop::array::uniform4(prop::array::uniform4(anything())),
    ) {
        let belief = Belief { state: [insertion, rotation, bending], deviation };
        let found = estimator(SETTINGS).estimate(&model(), &belief, measured, Some(&covariance));
        if let Some(found) = found {
            prop_assert!(found.estimate.state.iter().all(|value| value.is_finite()));
            for (after, before) in found.deviation.iter().zip(deviation) {
                prop_assert!(*after <= before * (1.0 + 1e-9), "{} {}", after, before);
            }
            let shown = found.used.iter().zip([[0, 1], [2, 3]]);
            for (used, places) in shown {
                prop_assert!(!used || places.iter().all(|place| measured[*place].is_finite()));
            }
        }
    }

    #[test]
    fn what_is_believed_and_seen_alike_stays(
        insertion in 0.015..0.035, rotation in -1.5..1.5, bending in 0.3..1.4,
    ) {
        let belief = Belief { state: [insertion, rotation, bending], deviation: [1e-3, 0.1, 0.1] };
        let prediction = model().predict(belief.state);
        prop_assume!(prediction.is_some());
        let seen = prediction.unwrap().features;
        let found = estimator(SETTINGS).estimate(&model(), &belief, seen, None).unwrap();
        prop_assert_eq!(found.estimate.state, belief.state);
        prop_assert_eq!(found.used, [true; 2]);
    }
}

#[test]
fn settings_are_checked() {
    let watch = StateEstimator::new([1.0; 3]).unwrap();
    let refused = |settings| WeightedEstimator::new(watch, settings).unwrap_err().field;
    let wrong = StateEstimationSettings {
        marker_deviation: 0.0,
        ..SETTINGS
    };
    assert_eq!(refused(wrong), "marker_deviation");
    let wrong = StateEstimationSettings {
        model_deviation: -1.0,
        ..SETTINGS
    };
    assert_eq!(refused(wrong), "model_deviation");
    let wrong = StateEstimationSettings {
        sideways_deviation: f64::NAN,
        ..SETTINGS
    };
    assert_eq!(refused(wrong), "sideways_deviation");
    let wrong = StateEstimationSettings {
        outlier_distance: 0.0,
        ..SETTINGS
    };
    assert_eq!(refused(wrong), "outlier_distance");
    let wrong = StateEstimationSettings {
        steps: 0,
        ..SETTINGS
    };
    assert_eq!(refused(wrong), "steps");
}
