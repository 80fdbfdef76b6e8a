//! Eq. (7) against the composition of many short rigid pieces, and its slopes against differences.

use crate::model::instrument::{Instrument, Marker};
use proptest::prelude::*;

use super::config;

const LENGTH: f64 = 0.0186;
const MARKERS: [f64; 2] = [0.005, 0.0125];

fn instrument() -> Instrument {
    Instrument::new(LENGTH, MARKERS[0], MARKERS[1], 0.0015, 0.003).unwrap()
}

pub fn states() -> impl Strategy<Value = [f64; 3]> {
    let bend = prop_oneof![4 => -2.0..2.0_f64, 1 => -1e-7..1e-7_f64, 1 => Just(0.0)];
    (-0.02..0.05_f64, -4.0..4.0_f64, bend)
        .prop_map(|(insertion, rotation, bend)| [insertion, rotation, bend])
}

/// Position and direction at a distance from the end of the section, from straight pieces that each turn a little.
fn composed([insertion, rotation, bend]: [f64; 3], distance: f64) -> ([f64; 3], [f64; 3]) {
    let pieces = 2000_u32;
    let direction = |angle: f64| {
        [
            angle.sin() * rotation.cos(),
            angle.sin() * rotation.sin(),
            angle.cos(),
        ]
    };
    let mut position = [0.0, 0.0, insertion];
    let mut advance = |angle: f64, length: f64| {
        for (place, part) in position.iter_mut().zip(direction(angle)) {
            *place += part * length;
        }
    };
    for piece in 0..pieces {
        let share = (f64::from(piece) + 0.5) / f64::from(pieces);
        advance(bend * share, LENGTH / f64::from(pieces));
    }
    advance(bend, distance);
    (position, direction(bend))
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_bands_are_where_many_short_pieces_lead(state in states()) {
        for (marker, distance) in instrument().markers(state).iter().zip(MARKERS) {
            let (position, axis) = composed(state, distance);
            for k in 0..3 {
                prop_assert!((marker.position[k] - position[k]).abs() <= 1e-6 * LENGTH);
                prop_assert!((marker.axis[k] - axis[k]).abs() <= 1e-12);
            }
        }
    }

    #[test]
    fn the_slopes_are_those_of_differences(state in states()) {
        for dof in 0..3 {
            let step = 1e-5;
            let moved = |by: f64| {
                let mut state = state;
                state[dof] += by;
                instrument().markers(state)
            };
            let (before, after) = (moved(-step), moved(step));
            let slope = |of: fn(&Marker) -> [f64; 3], band: usize, k: usize| {
                (of(&after[band])[k] - of(&before[band])[k]) / (2.0 * step)
            };
            for (band, marker) in instrument().markers(state).iter().enumerate() {
                for k in 0..3 {
                    let position = slope(|marker| marker.position, band, k);
                    let axis = slope(|marker| marker.axis, band, k);
                    prop_assert!((marker.position_by_dof[dof][k] - position).abs() <= 1e-9);
                    prop_assert!((marker.axis_by_dof[dof][k] - axis).abs() <= 1e-9);
                }
            }
        }
    }
}

#[test]
fn bad_lengths_are_named() {
    let field = |a, b, c, d, e| Instrument::new(a, b, c, d, e).unwrap_err().field;
    assert_eq!(field(0.0, 0.0, 0.0, 0.0, 0.0), "bending_length");
    assert_eq!(field(1.0, -1.0, 0.0, 0.0, 0.0), "marker_a");
    assert_eq!(field(1.0, 0.0, -1.0, 0.0, 0.0), "marker_b");
    assert_eq!(field(1.0, 0.0, 0.0, -1.0, 0.0), "radius");
    assert_eq!(field(1.0, 0.0, 0.0, 0.0, f64::NAN), "band_length");
    let sizes = Instrument::new(1.0, 0.0, 0.0, 2.0, 3.0).unwrap();
    assert_eq!((sizes.radius, sizes.band_length), (2.0, 3.0));
}
