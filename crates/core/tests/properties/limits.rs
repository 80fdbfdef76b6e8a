//! Limits of the estimated slack.

use crate::article::estimator::EstimatorState;
use crate::article::play::Play;
use crate::article::play_limit::PlayLimit;
use proptest::prelude::*;

use super::config;

const WIDTH: f64 = 12.0;
const OFFSET: f64 = 8.0;

#[test]
fn limits_out_of_range_are_named() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = PlayLimit::new(bad, 1.0).unwrap_err().to_string();
        assert!(error.contains("width_limit"), "{error}");
        let error = PlayLimit::new(1.0, bad).unwrap_err().to_string();
        assert!(error.contains("offset_limit"), "{error}");
    }
}

#[test]
fn a_limit_may_be_reached_and_not_exceeded() {
    let limit = PlayLimit::new(WIDTH, OFFSET).unwrap();
    for side in [-1.0, 1.0] {
        assert!(limit.allows(side * OFFSET));
        assert!(!limit.allows(side * OFFSET.next_up()));
    }
    assert!(!limit.exceeds(-4.0, 8.0) && !limit.exceeds(-8.0, 4.0));
    assert!(limit.exceeds(-4.5, 8.0), "too wide");
    assert!(
        limit.exceeds(-8.5, -8.0) && limit.exceeds(8.0, 8.5),
        "too far"
    );
    assert!(!PlayLimit::NONE.exceeds(-1e300, 1e300));
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn offsets_within_the_limits_stay_and_others_move_to_the_nearest(
        minus in -20.0..20.0_f64, width in 0.0..30.0_f64,
    ) {
        let (limit, plus) = (PlayLimit::new(WIDTH, OFFSET).unwrap(), minus + width);
        let [low, high] = limit.clamp(minus, plus);
        prop_assert!(low <= high);
        prop_assert!(high - low <= WIDTH + 1e-12 && low.abs() <= OFFSET && high.abs() <= OFFSET);
        if limit.exceeds(minus, plus) {
            // Each to its own limit first; what is then too wide loses alike on both sides.
            let [least, most] = [minus, plus].map(|value| value.clamp(-OFFSET, OFFSET));
            prop_assert!((low - least - (most - high)).abs() <= 1e-12);
            prop_assert!((high - low - WIDTH.min(most - least)).abs() <= 1e-12);
        } else {
            prop_assert_eq!([low, high], [minus, plus]);
        }
    }
}

#[test]
fn an_estimate_is_limited_only_beyond_the_limit() {
    let limit = PlayLimit::new(WIDTH, OFFSET).unwrap();
    for (minus, plus, exceeds) in [(-4.0, 8.0, false), (-8.0, 8.0, true), (7.0, 9.0, true)] {
        let before = Play::new(minus, plus).unwrap();
        let mut state = EstimatorState::new(before);
        assert_eq!(state.limit(limit), exceeds);
        assert_eq!(state.play() != before, exceeds);
        assert!(!limit.exceeds(state.play().delta_minus(), state.play().delta_plus()));
    }
}
