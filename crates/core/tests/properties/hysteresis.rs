//! Hysteresis of the three DOFs: one friction, none in common, and parameters that change.

use crate::article::play::{Play, PlayState};
use crate::dof::PerDof;
use crate::model::friction::slide;
use crate::model::hysteresis::{Hysteresis, PlayPosition};
use proptest::prelude::*;

use super::config;

const RADIUS: f64 = 1.75e-3;

fn hystereses(shared: impl Strategy<Value = f64>) -> impl Strategy<Value = Hysteresis> {
    let half = (1e-3..8e-3, 0.1..1.5, 0.05..1.0);
    let centre = (-2e-3..2e-3, -0.3..0.3, -0.2..0.2);
    (half, centre, shared).prop_map(|((h1, h2, h3), (m1, m2, m3), shared)| Hysteresis {
        half_width: [h1, h2, h3],
        centre: [m1, m2, m3],
        shared,
    })
}

/// Commands, each a straight motion from the last.
fn commands() -> impl Strategy<Value = Vec<PerDof<f64>>> {
    let command = (-20e-3..20e-3, -3.0..3.0, -2.0..2.0).prop_map(|(a, b, c)| [a, b, c]);
    prop::collection::vec(command, 1..20)
}

/// Contact offsets of each DOF that moves alone [m, rad, rad].
fn offsets(hysteresis: &Hysteresis) -> PerDof<(f64, f64)> {
    [0, 1, 2].map(|dof| {
        let (half, centre) = (hysteresis.half_width[dof], hysteresis.centre[dof]);
        (centre - half, centre + half)
    })
}

fn run(
    hysteresis: &Hysteresis,
    commands: &[PerDof<f64>],
    mut see: impl FnMut(PerDof<f64>, &PlayPosition),
) {
    let (mut position, mut last) = (PlayPosition::at([0.0; 3]), [0.0; 3]);
    // The plays begin within their bands.
    position = hysteresis.propagate(RADIUS, &position, last, last);
    for command in commands {
        position = hysteresis.propagate(RADIUS, &position, last, *command);
        last = *command;
        see(last, &position);
    }
}

proptest! {
    #![proptest_config(config())]

    /// A share of 1: the deflection is that of the vector play, and the output is the shaft.
    #[test]
    fn one_friction_is_the_vector_play(hysteresis in hystereses(Just(1.0)), commands in commands()) {
        let ([h1, h2, _], [m1, m2, _]) = (hysteresis.half_width, hysteresis.centre);
        let (mut n, mut last) = ([-m1 / h1, -m2 / h2], [0.0; 3]);
        let length = n[0].hypot(n[1]).max(1.0);
        n = n.map(|n| n / length);
        run(&hysteresis, &commands, |command, position| {
            let motion = [(command[0] - last[0]) / h1, (command[1] - last[1]) / h2];
            n = slide(n, motion, h1 / (RADIUS * h2));
            last = command;
            let expected = [command[0] - m1 - h1 * n[0], command[1] - m2 - h2 * n[1]];
            for (dof, expected) in expected.into_iter().enumerate() {
                assert!((position.output[dof] - expected).abs() <= 1e-9, "{position:?} {expected}");
                assert!((position.shaft[dof] - position.output[dof]).abs() <= 1e-9);
            }
        });
    }

    /// A share of 0 is three plays of Eq. (1), but for the little that a vector play needs; bending always is one.
    #[test]
    fn no_friction_in_common_is_three_plays(hysteresis in hystereses(Just(0.0)), commands in commands()) {
        let plays = offsets(&hysteresis).map(|(minus, plus)| Play::new(minus, plus).unwrap());
        let mut tips = [PlayState { output: 0.0 }; 3];
        for (play, tip) in plays.iter().zip(&mut tips) {
            play.step(tip, 0.0);
        }
        run(&hysteresis, &commands, |command, position| {
            for dof in 0..3 {
                plays[dof].step(&mut tips[dof], command[dof]);
                let off = (position.output[dof] - tips[dof].output).abs();
                let allowed = if dof < 2 { 4e-3 * hysteresis.half_width[dof] } else { 1e-12 };
                assert!(off <= allowed, "{dof}: {off}");
            }
        });
    }

    /// Whatever the share, a DOF that moves alone is the play of Eq. (1).
    #[test]
    fn a_dof_alone_is_its_play(hysteresis in hystereses(0.0..1.0), commands in commands(), dof in 0..3_usize) {
        let hysteresis = Hysteresis { centre: [0.0; 3], ..hysteresis };
        let (minus, plus) = offsets(&hysteresis)[dof];
        let (play, mut tip) = (Play::new(minus, plus).unwrap(), PlayState { output: 0.0 });
        let alone: Vec<PerDof<f64>> = commands
            .iter()
            .map(|command| {
                let mut only = [0.0; 3];
                only[dof] = command[dof];
                only
            })
            .collect();
        run(&hysteresis, &alone, |command, position| {
            play.step(&mut tip, command[dof]);
            assert!((position.output[dof] - tip.output).abs() <= 1e-9 * plus.max(1e-3));
        });
    }

    /// After a change of the parameters every DOF is within its new band, and another motion of none changes nothing.
    #[test]
    fn changed_parameters_leave_the_plays_within_their_bands(
        before in hystereses(0.0..1.0), after in hystereses(0.0..1.0), commands in commands(),
    ) {
        run(&before, &commands, |command, position| {
            let moved = after.propagate(RADIUS, position, command, command);
            for (dof, (minus, plus)) in offsets(&after).into_iter().enumerate() {
                let offset = command[dof] - moved.output[dof];
                let rounding = 1e-12 * (1.0 + command[dof].abs());
                assert!((minus - rounding..=plus + rounding).contains(&offset), "{dof}: {offset}");
            }
            let again = after.propagate(RADIUS, &moved, command, command);
            for dof in 0..3 {
                assert!((again.output[dof] - moved.output[dof]).abs() <= 1e-12);
            }
        });
    }
}
