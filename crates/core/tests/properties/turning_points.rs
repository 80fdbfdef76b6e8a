//! Turning points of a sine with noise, and of values that are not finite.

use crate::supervision::turning_points::TurningPoints;

#[test]
fn a_sine_turns_twice_a_period_and_noise_within_the_band_never() {
    let mut points = TurningPoints::new(0.1);
    let mut found = [0.0; 8];
    let mut count = 0;
    for tick in 0..4000 {
        let time = f64::from(tick) * 1e-3;
        let noise = if tick % 2 == 0 { 0.02 } else { -0.02 };
        let value = libm::sin(core::f64::consts::TAU * time) + noise;
        if let Some(swing) = points.update(value) {
            found[count] = swing;
            count += 1;
        }
    }
    assert_eq!(count, 8);
    assert!((found[0] - 1.0).abs() < 0.05, "{found:?}");
    for swing in &found[1..] {
        assert!((swing - 2.0).abs() < 0.05, "{found:?}");
    }
}

#[test]
fn values_that_are_not_finite_are_ignored() {
    let mut points = TurningPoints::new(0.1);
    assert_eq!(points.update(f64::NAN), None);
    for value in [0.0, 1.0, f64::NAN, 2.0] {
        assert_eq!(points.update(value), None);
    }
    assert!(points.direction() > 0.0 && points.is_extreme(2.0));
    assert_eq!(points.update(1.5), Some(2.0));
    assert!(points.direction() < 0.0 && !points.is_extreme(2.0));
}
