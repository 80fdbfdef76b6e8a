//! Eq. (1).

use crate::article::play::{Play, PlayState};
use proptest::prelude::*;

use super::{close, config, path, plays, turning_points};

proptest! {
    #![proptest_config(config())]

    #[test]
    fn output_stays_in_the_band_and_moves_only_in_contact(
        play in plays(), inputs in turning_points()
    ) {
        let mut state = PlayState { output: 0.0 };
        let mut last = (inputs[0], play.step(&mut state, inputs[0]));
        for input in path(&inputs, 7) {
            let output = play.step(&mut state, input);
            prop_assert!(input - play.delta_plus() <= output);
            prop_assert!(output <= input - play.delta_minus());
            let (moved_in, moved_out) = (input - last.0, output - last.1);
            if input - play.delta_plus() < output && output < input - play.delta_minus() {
                prop_assert_eq!(moved_out, 0.0);
            } else {
                prop_assert!(moved_in * moved_out >= 0.0);
                prop_assert!(moved_out.abs() <= moved_in.abs() + 1e-15);
            }
            last = (input, output);
        }
    }

    #[test]
    fn only_the_turning_points_matter(play in plays(), inputs in turning_points()) {
        let end = |steps| {
            let mut state = PlayState { output: 0.0 };
            path(&inputs, steps).iter().map(|input| play.step(&mut state, *input)).last()
        };
        prop_assert_eq!(end(1), end(13));
    }

    #[test]
    fn the_width_is_the_travel_that_moves_nothing(play in plays(), start in -5.0..5.0) {
        let mut state = PlayState { output: start - play.delta_plus() };
        let held = play.step(&mut state, start);
        prop_assert!(close(play.step(&mut state, start - play.width()), held));
        let beyond = play.step(&mut state, start - play.width() - 1.0);
        prop_assert!(close(beyond, held - 1.0));
    }
}

#[test]
fn bad_offsets_are_named() {
    let error = Play::new(1.0, 0.5).unwrap_err();
    assert_eq!((error.field, error.value), ("delta_minus", 1.0));
    assert_eq!(Play::new(0.0, f64::NAN).unwrap_err().field, "delta_plus");
}

#[test]
fn an_input_that_is_not_finite_holds_the_output() {
    let play = Play::new(-1.0, 1.0).unwrap();
    let mut state = PlayState { output: 0.25 };
    for input in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(play.step(&mut state, input).to_bits(), 0.25_f64.to_bits());
    }
}
