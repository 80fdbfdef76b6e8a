//! Hysteresis of the three DOFs: one friction, none in common, and parameters that change.

use crate::article::play::{Play, PlayState};
use crate::dof::PerDof;
use crate::estimation::path::straight_pieces;
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

    /// Straight pieces end at ticks of the path, at its end too, and the plays after them are those of every tick, but for
    /// the distance of the path from its pieces.
    #[test]
    fn straight_pieces_move_the_plays_alike(
        hysteresis in hystereses(0.0..1.0), commands in commands(), bent in prop::collection::vec(-1.0..1.0_f64, 20), ticks in 1..12_u32,
    ) {
        let unit = [6e-3, 1.3, 0.75];
        // Each motion in ticks, along an arc that is up to a fifth of a unit from straight.
        let (mut path, mut last) = (Vec::new(), [0.0; 3]);
        for (command, bent) in commands.iter().zip(bent) {
            for tick in 1..=ticks {
                let share = f64::from(tick) / f64::from(ticks);
                let side = 0.8 * bent * share * (1.0 - share);
                path.push([0, 1, 2].map(|dof| {
                    last[dof] + share * (command[dof] - last[dof]) + [side, -side, 0.0][dof] * unit[dof]
                }));
            }
            last = *command;
        }
        let pieces: Vec<_> = straight_pieces(path.iter().copied(), [0.0; 3], unit).collect();
        prop_assert_eq!(pieces.last(), path.last());
        prop_assert!(pieces.iter().all(|end| path.contains(end)));
        let (mut each, mut few) = (Vec::new(), Vec::new());
        run(&hysteresis, &path, |_, position| each.push(*position));
        run(&hysteresis, &pieces, |_, position| few.push(*position));
        let (each, few) = (each[each.len() - 1], few[few.len() - 1]);
        for (dof, unit) in unit.into_iter().enumerate() {
            let off = (each.output[dof] - few.output[dof]).abs() / unit;
            prop_assert!(off <= 0.01 * f64::from(u8::from(dof < 2)) + 1e-9, "{dof}: {off} after {} of {}", pieces.len(), path.len());
        }
    }

    /// Of a straight line at any speed one piece remains.
    #[test]
    fn a_short_straight_line_is_one_piece(end in prop::array::uniform3(-0.05..0.05_f64), mut shares in prop::collection::vec(0.0..1.0_f64, 1..20)) {
        shares.sort_by(f64::total_cmp);
        let path: Vec<_> = shares.iter().map(|share| end.map(|end| share * end)).collect();
        let pieces: Vec<_> = straight_pieces(path.iter().copied(), [0.0; 3], [1.0; 3]).collect();
        prop_assert_eq!(pieces, vec![path[path.len() - 1]]);
    }

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
        let plays = hysteresis.offsets().map(|(minus, plus)| Play::new(minus, plus).unwrap());
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
        let (minus, plus) = hysteresis.offsets()[dof];
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
            for (dof, (minus, plus)) in after.offsets().into_iter().enumerate() {
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

    /// Where the tip slides steadily, command less output is the centre and the steady deflection.
    #[test]
    fn steady_sliding_has_the_steady_deflection(
        hysteresis in hystereses(0.01..1.0), heading in -3.1..3.1_f64, up in any::<bool>(),
    ) {
        let (w, third) = ([heading.cos(), heading.sin()], if up { 1.0 } else { -1.0 });
        // The surface moves along w: (dq1, r dq2).
        let far = [0.5 * w[0], 0.5 * w[1] / RADIUS, 5.0 * third];
        run(&hysteresis, &[far], |command, position| {
            let steady = hysteresis.steady_deflection([w[0], w[1], third]);
            for dof in 0..3 {
                let lead = command[dof] - position.output[dof] - hysteresis.centre[dof];
                let size = hysteresis.half_width[dof];
                // The plays of each DOF by itself add to it only where that DOF moves.
                if far[dof].abs() > 0.1 {
                    assert!((lead - steady[dof]).abs() <= 1e-6 * size, "{dof}: {lead} {}", steady[dof]);
                }
            }
        });
    }
}
