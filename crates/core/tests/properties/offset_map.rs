//! The offsets over position.

use crate::adaptive::offset_map::{OffsetMap, OffsetPrior, Side};
use proptest::prelude::*;

use super::{close, config};

pub fn prior() -> OffsetPrior {
    OffsetPrior {
        spacing: 0.25,
        level: 1.0,
        tilt: 0.2,
        local: 0.1,
        correlation: 1.0,
        level_drift: 0.01,
        tilt_drift: 0.01,
        local_drift: 0.005,
        symmetry: 0.8,
    }
}

fn measurements() -> impl Strategy<Value = Vec<(bool, f64, f64, f64)>> {
    prop::collection::vec((any::<bool>(), -6.0..6.0, -1.0..1.0, 0.001..1.0), 1..60)
}

const fn side(plus: bool) -> Side {
    if plus { Side::Plus } else { Side::Minus }
}

proptest! {
    #![proptest_config(config())]

    /// What a scalar measurement does to a normal variable, from the variance alone.
    #[test]
    fn a_measurement_weighs_as_its_variance(
        position in -3.0..3.0, offset in -2.0..2.0, variance in 0.01..4.0
    ) {
        let mut map = OffsetMap::new(prior(), 0.0, 0.0);
        let before = map.variance(Side::Plus, position);
        map.measure(Side::Plus, position, 1.0, offset, variance);
        prop_assert!(close(map.offset(Side::Plus, position), offset * before / (before + variance)));
        let after = before * variance / (before + variance);
        prop_assert!((map.variance(Side::Plus, position) - after).abs() < 1e-9);
    }

    #[test]
    fn measuring_never_makes_less_certain_and_travel_never_more(
        measurements in measurements(), probe in -5.0..5.0
    ) {
        let mut map = OffsetMap::new(prior(), -1.0, 1.0);
        // Of a sum: that of level and local part, and that of the tilt.
        let most_ever = (1.01_f64.sqrt() + 0.2 * f64::abs(probe)).powi(2);
        for (plus, position, offset, variance) in measurements {
            for both in [Side::Minus, Side::Plus] {
                let before = map.variance(both, probe);
                prop_assert!((0.0..=most_ever * (1.0 + 1e-9)).contains(&before));
                let mut later = map.clone();
                later.travel(0.5);
                let most = later.variance(both, probe);
                prop_assert!(most >= before.min(1.0) * (1.0 - 0.02));
            }
            let before = map.variance(side(plus), probe);
            map.measure(side(plus), position, 1.0, offset, variance);
            prop_assert!(map.variance(side(plus), probe) <= before + 1e-9);
            map.travel(0.1);
        }
    }

    #[test]
    fn a_bound_leaves_the_other_contact_and_the_variance(
        position in -3.0..3.0, offset in 0.0..3.0, variance in 0.01..1.0
    ) {
        let mut map = OffsetMap::new(prior(), -1.0, 1.0);
        let before = (map.variance(Side::Plus, position), map.offset(Side::Minus, position));
        map.bound(Side::Plus, position, offset, variance);
        let after = (map.variance(Side::Plus, position), map.offset(Side::Minus, position));
        prop_assert_eq!(before, after);
    }
}

#[test]
fn friction_that_fell_at_one_contact_is_expected_to_have_fallen_at_the_other() {
    let mut map = OffsetMap::new(prior(), -1.0, 1.0);
    map.measure(Side::Minus, 0.0, 1.0, -0.5, 1e-3);
    assert!(map.offset(Side::Plus, 0.0) < 0.7);
}

/// Contacts seen over a range of positions tell a tip of another scale, and its uncertainty.
#[test]
fn the_tilt_is_found_from_the_slope_of_the_offsets() {
    let mut map = OffsetMap::new(prior(), 0.0, 0.0);
    for step in -20..=20 {
        let position = 0.1 * f64::from(step);
        map.measure(Side::Plus, position, 1.0, 0.4 + 0.5 * position, 1e-4);
        map.measure(Side::Minus, position, 1.0, -0.4 + 0.5 * position, 1e-4);
    }
    let (tilt, deviation) = map.tilt();
    assert!((tilt - 0.5).abs() < 3.0 * deviation, "{tilt} {deviation}");
    assert!(deviation < 0.1);
    // Beyond the nodes the tilt goes on.
    let beyond = map.offset(Side::Plus, 20.0) - map.offset(Side::Plus, 10.0);
    assert!((beyond - 10.0 * tilt).abs() < 1e-9);
}
