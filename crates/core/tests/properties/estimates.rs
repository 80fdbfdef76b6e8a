//! Centre map, rate limit of the offsets, and direction of motion.

use crate::adaptive::offset_rate_limit::OffsetRateLimit;
use crate::adaptive::slip_direction::SlipDirection;
use crate::adaptive::smoother::Smoother;
use crate::estimation::centre_map::CentreMap;
use crate::model::hysteresis::Hysteresis;
use proptest::prelude::*;

use super::config;

proptest! {
    #![proptest_config(config())]

    /// Exact at its nodes and where it was changed, linear between nodes, constant beyond the last.
    #[test]
    fn the_centre_map_interpolates(
        middle in -3.0..3.0_f64, spacing in 0.1..2.0_f64, changes in prop::collection::vec((-10.0..10.0_f64, -1.0..1.0_f64), 1..10),
        place in 0..16_usize, share in 0.0..1.0_f64,
    ) {
        let mut map = CentreMap::new(middle, spacing);
        for (position, change) in changes {
            let before = map.at(middle + spacing * position);
            map.add(middle + spacing * position, change);
            prop_assert!((map.at(middle + spacing * position) - before - change).abs() <= 1e-9);
        }
        let node = |index: f64| -> f64 { map.at(middle + spacing * (index - 8.0)) };
        #[expect(clippy::cast_precision_loss, reason = "at most 15")]
        let index = place as f64;
        let between = node(index) + share * (node(index + 1.0) - node(index));
        prop_assert!((node(index + share) - between).abs() <= 1e-9);
        prop_assert!((node(-3.0) - node(0.0)).abs() <= 1e-12 && (node(40.0) - node(16.0)).abs() <= 1e-12);
    }

    /// Once it is known, what is used of half width and centre changes no faster than the rate, whatever is estimated;
    /// and what was correct is used again at once.
    #[test]
    fn known_offsets_change_no_faster_than_their_rate(
        estimates in prop::collection::vec((0.1..20.0, -20.0..20.0, 0..30_u32), 1..40),
    ) {
        let (rate, period) = ([0.5, 0.2, 0.1], 0.01);
        let mut limit = OffsetRateLimit::new(rate, 1.0, period);
        limit.step([2.0; 3]);
        let mut estimate = Hysteresis { half_width: [5.0; 3], centre: [0.0; 3], shared: 0.5 };
        let start = estimate;
        limit.update([[5.0; 3], [0.0; 3]], [[5.0; 3], [0.0; 3]]);
        let mut ticks = 0_u32;
        for (half, centre, moving) in estimates {
            for _ in 0..moving {
                limit.step([0.01; 3]);
            }
            ticks += moving;
            limit.update([estimate.half_width, estimate.centre], [[half; 3], [centre; 3]]);
            estimate = Hysteresis { half_width: [half; 3], centre: [centre; 3], ..estimate };
            let used = limit.apply(&estimate);
            for (dof, rate) in rate.into_iter().enumerate() {
                let most = rate * period * f64::from(ticks) + 1e-9;
                prop_assert!((used.half_width[dof] - start.half_width[dof]).abs() <= most);
                prop_assert!((used.centre[dof] - start.centre[dof]).abs() <= most);
            }
        }
    }

    /// Unit length and the direction of the surface's motion, after any detour; tremor within the travel turns nothing.
    #[test]
    fn the_direction_is_that_of_the_motion_of_the_surface(
        detour in prop::collection::vec(prop::array::uniform3(-1.0..1.0), 0..20),
        heading in -3.1..3.1_f64, bending in prop_oneof![Just(-1.0), Just(1.0)], radius in 0.1..3.0,
    ) {
        let mut direction = SlipDirection::new(radius, [0.05, 0.05, 0.02], 0.0, 0.01);
        let mut reference = [0.0; 3];
        direction.step(reference);
        prop_assert_eq!(direction.value(), [0.0; 3]);
        for step in detour {
            for (value, step) in reference.iter_mut().zip(step) {
                *value += step;
            }
            direction.step(reference);
            let [a, b, _] = direction.value();
            prop_assert!((a.hypot(b) - 1.0).abs() <= 1e-12 || (a, b) == (0.0, 0.0));
        }
        let (c, s) = (heading.cos(), heading.sin());
        for _ in 0..1000 {
            reference = [reference[0] + 0.01 * c, reference[1] + 0.01 * s / radius, reference[2] + 0.01 * bending];
            direction.step(reference);
        }
        let [a, b, third] = direction.value();
        prop_assert!((a - c).hypot(b - s) <= 1e-6 && third * bending > 0.0);
        // Counted from elsewhere, nothing turns.
        let shift = [3.0, -2.0, 1.0];
        direction.shift(shift);
        let moved = [0, 1, 2].map(|dof| reference[dof] + shift[dof]);
        direction.step(moved);
        let [x, y, z] = direction.value();
        prop_assert!((a - x).hypot(b - y) <= 1e-9 && (z - third).abs() <= 1e-9);
    }

    /// A ramp is followed without lag; a shift passes through.
    #[test]
    fn a_smoothed_ramp_has_no_lag(speed in -3.0..3.0_f64, time in 0.02..0.3, start in -2.0..2.0_f64, shift in -5.0..5.0) {
        let mut smoother = Smoother::new(time, 0.005);
        let mut input = start;
        prop_assert!((smoother.step(input) - start).abs() <= 1e-12);
        let mut found = start;
        for _ in 0..2000 {
            input += 0.005 * speed;
            found = smoother.step(input);
        }
        prop_assert!((found - input).abs() <= 1e-6, "{}", found - input);
        smoother.shift(shift);
        prop_assert!((smoother.step(input + shift) - input - shift).abs() <= 0.01 * speed.abs() + 1e-6);
        prop_assert_eq!(Smoother::new(0.0, 0.005).step(start), start);
    }
}

/// Amplitude of a sine of 10 Hz behind the smoother, over its input: well below a half.
#[test]
fn tremor_is_smoothed() {
    let mut smoother = Smoother::new(0.15, 0.005);
    let mut largest = 0.0_f64;
    for tick in 0..2000 {
        let value = smoother.step((std::f64::consts::TAU * 10.0 * 0.005 * f64::from(tick)).sin());
        if tick > 1000 {
            largest = largest.max(value.abs());
        }
    }
    assert!((0.1..0.3).contains(&largest), "{largest}");
}
