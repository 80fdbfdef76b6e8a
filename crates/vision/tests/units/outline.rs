//! Outlines that the image cuts.

use super::*;
use crate::math::real;

/// A rectangle of 20 x 20 px, its corners along two sides.
fn square([u, v]: [f64; 2]) -> Outline {
    let side = OUTLINE_CORNERS / 2;
    let corner = |index: usize| {
        let share = 20.0 * real(index % side) / real(side - 1) - 10.0;
        if index < side {
            [u + share, v - 10.0]
        } else {
            [u - share, v + 10.0]
        }
    };
    Outline {
        corners: std::array::from_fn(corner),
        centroid: [u, v],
        area: 400.0,
    }
}

#[test]
fn centroid_within_is_that_of_the_part_in_the_image() {
    let mut map = RunMap::default();
    map.start(100, 80);
    map.end_rows(80);
    // Centre of the square, and the middle of its part in [0, 99] x [0, 79].
    for ([u, v], middle) in [
        ([50.0, 40.0], [50.0, 40.0]),
        ([0.0, 40.0], [5.0, 40.0]),
        ([95.0, 77.0], [92.0, 73.0]),
    ] {
        let [seen_u, seen_v] = square([u, v]).centroid_within(&map).unwrap();
        let off = (seen_u - middle[0]).hypot(seen_v - middle[1]);
        assert!(off < 0.8, "{u} {v}: {seen_u} {seen_v}");
    }
    assert_eq!(square([50.0, 88.0]).centroid_within(&map), None);
    assert_eq!(square([300.0, 40.0]).centroid_within(&map), None);
}
