//! A frame full of noise.

use super::*;

#[test]
fn a_marker_below_any_amount_of_noise_is_found() {
    let (width, height) = (2_000, 200);
    let mut map = RunMap::default();
    map.start(width, height);
    for v in 0..height - 1 {
        for start in (v % 2..width).step_by(2) {
            map.add(v, start, start + 1);
        }
    }
    map.add(height - 1, 500, 600);
    map.end_rows(height);
    assert!(map.runs.len() > 2 * USUAL_RUNS);
    assert!(map.is_marker([550.0, 199.0]) && !map.is_marker([600.0, 199.0]));
    let same = |left: f64, right: f64| (left - right).abs() < f64::EPSILON;
    assert!(same(map.count(199.0, 0.0, 1_999.0), 100.0));
}
