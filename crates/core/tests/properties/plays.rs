//! Plays of fixed radii, against the scalar play and the exact vector play.

use crate::article::play::{Play, PlayState};
use crate::dof::Friction;
use crate::model::friction::slide;
use crate::model::plays::{Plays, SHARED, Transmission};
use proptest::prelude::*;

use super::config;

/// Largest motion of the command in a control tick, in units.
const TICK: f64 = 0.02;

/// N DOFs in groups, with these levers and units.
fn transmission<const N: usize>(
    group: [usize; N],
    lever: [f64; N],
    unit: [f64; N],
) -> Transmission<N> {
    Transmission::new(Friction::new(group, lever).unwrap(), unit).unwrap()
}

fn sizes<const N: usize>() -> impl Strategy<Value = [f64; N]> {
    prop::array::uniform::<_, N>(0.4..2.5_f64)
}

/// Sizes of the DOFs of a shaft: of the surfaces that rub, none moves more than 2.5 times as far as another.
fn alike<const N: usize>() -> impl Strategy<Value = [f64; N]> {
    prop::array::uniform::<_, N>(0.8..1.25_f64)
}

fn path<const N: usize>(count: usize) -> impl Strategy<Value = Vec<[f64; N]>> {
    prop::collection::vec(prop::array::uniform::<_, N>(-3.0..3.0_f64), 1..count)
}

/// The commands on straight lines through the points, each motion at most `step` long.
fn commands<const N: usize>(points: &[[f64; N]], step: f64) -> Vec<[f64; N]> {
    let (mut at, mut all) = ([0.0; N], vec![]);
    for point in points {
        let farthest = (0..N).map(|dof| (point[dof] - at[dof]).abs());
        let farthest = farthest.fold(0.0, f64::max);
        let mut left = farthest;
        while left > 0.0 {
            left = (left - step).max(0.0);
            let share = left / farthest;
            all.push(core::array::from_fn(|dof| {
                point[dof] + share * (at[dof] - point[dof])
            }));
        }
        at = *point;
    }
    all
}

/// Radii of the plays of each DOF, in the order of the regressors.
fn all_radii<const N: usize>(transmission: &Transmission<N>) -> [Vec<f64>; N] {
    transmission
        .dofs()
        .each_ref()
        .map(|dof| dof.all().collect())
}

/// Outputs of the plays of a DOF that are of its friction group, and of those by itself.
fn outputs<const N: usize>(plays: &Plays<N>) -> [Vec<f64>; N] {
    let radii = Transmission::<1>::new(Friction::independent(), [1.0]);
    let count = all_radii(&radii.unwrap())[0].len();
    plays.regressors().map(|row| row[..count].to_vec())
}

/// Largest sum of (e / h)^2 over the groups and their vector plays.
fn fullest<const N: usize>(transmission: &Transmission<N>, plays: &Plays<N>) -> f64 {
    let (radii, outputs) = (all_radii(transmission), outputs(plays));
    let mut most = 0.0_f64;
    for group in 0..N {
        let members = transmission.friction().members(group);
        for index in 0..SHARED {
            let dofs = (0..N).filter(|dof| members[*dof]);
            let parts =
                dofs.map(|dof| (plays.command[dof] - outputs[dof][index]) / radii[dof][index]);
            most = most.max(parts.map(|part| part * part).sum());
        }
    }
    most
}

/// The scalar plays: all of a DOF alone, and the own ones of any DOF.
fn check_scalar<const N: usize>(
    transmission: &Transmission<N>,
    points: &[[f64; N]],
) -> Result<(), TestCaseError> {
    let (mut plays, mut states) = (Plays::REST, vec![]);
    let radii = all_radii(transmission);
    for (dof, radii) in radii.iter().enumerate() {
        let first = if transmission.dofs()[dof].is_alone {
            0
        } else {
            SHARED
        };
        for (index, radius) in radii.iter().enumerate().skip(first) {
            let play = Play::new(-radius, *radius).unwrap();
            states.push((dof, index, play, PlayState { output: 0.0 }));
        }
    }
    let mut travel = 0.0;
    for point in points {
        travel += (0..N)
            .map(|dof| (point[dof] - plays.command[dof]).abs())
            .sum::<f64>();
        transmission.advance(&mut plays, point);
        let outputs = outputs(&plays);
        for (dof, index, play, state) in &mut states {
            prop_assert_eq!(play.step(state, point[*dof]), outputs[*dof][*index]);
        }
        prop_assert_eq!(plays.command, *point);
        prop_assert!((plays.travel - travel).abs() <= 1e-9);
    }
    Ok(())
}

/// Within the friction ellipse at any speed of a tick, and unmoved at rest.
fn check_vector<const N: usize>(
    transmission: &Transmission<N>,
    points: &[[f64; N]],
) -> Result<(), TestCaseError> {
    let mut plays = Plays::REST;
    for command in commands(points, TICK) {
        transmission.advance(&mut plays, &command);
        let full = fullest(transmission, &plays);
        prop_assert!(full <= 1.0 + 1e-6, "{full} at {command:?}");
    }
    let mut rested = plays;
    for _ in 0..20 {
        transmission.advance(&mut rested, &plays.command);
    }
    prop_assert_eq!(rested.travel, plays.travel);
    for (rested, before) in outputs(&rested).iter().zip(&outputs(&plays)) {
        for (rested, before) in rested.iter().zip(before) {
            prop_assert!((rested - before).abs() <= 1e-6, "{rested} {before}");
        }
    }
    Ok(())
}

/// A group of which one DOF moves alone: its vector plays are scalar ones, and the outputs of the others stay.
fn check_one_moves<const N: usize>(
    transmission: &Transmission<N>,
    dof: usize,
    points: &[[f64; 1]],
) -> Result<(), TestCaseError> {
    let radii = all_radii(transmission);
    let mut states: Vec<_> = radii[dof]
        .iter()
        .map(|radius| (Play::new(-radius, *radius), 0.0))
        .collect();
    let mut plays = Plays::REST;
    for [to] in commands(points, TICK) {
        let mut command = [0.0; N];
        command[dof] = to;
        transmission.advance(&mut plays, &command);
        let outputs = outputs(&plays);
        for ((play, output), found) in states.iter_mut().zip(&outputs[dof]) {
            let mut state = PlayState { output: *output };
            *output = play.as_ref().unwrap().step(&mut state, to);
            prop_assert!((*output - found).abs() <= 1e-6, "{output} {found}");
        }
        for other in (0..N).filter(|other| *other != dof) {
            prop_assert!(outputs[other].iter().all(|output| *output == 0.0));
        }
    }
    Ok(())
}

/// Largest distance of the outputs in half widths.
fn apart<const N: usize>(transmission: &Transmission<N>, a: &Plays<N>, b: &Plays<N>) -> f64 {
    let (a, b) = (outputs(a), outputs(b));
    let mut most = 0.0_f64;
    for (dof, radii) in all_radii(transmission).iter().enumerate() {
        for (index, radius) in radii.iter().enumerate().take(SHARED) {
            most = most.max((a[dof][index] - b[dof][index]).abs() / radius);
        }
    }
    most
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..config() })]

    #[test]
    fn plays_of_a_dof_by_itself_are_scalar_plays(
        one in path::<1>(20), two in path::<2>(20), three in path::<3>(20), eight in path::<8>(20),
    ) {
        check_scalar(&transmission([0], [2.0], [0.3]), &one)?;
        check_scalar(&transmission([0, 1], [1.0; 2], [1.0; 2]), &two)?;
        check_scalar(&transmission([0, 0, 2], [1.0, 2.0, 1.0], [1.0, 0.1, 3.0]), &three)?;
        check_scalar(&transmission([0, 1, 1, 3, 0, 0, 7, 5], [1.0; 8], [1.0; 8]), &eight)?;
    }

    #[test]
    fn deflections_are_within_the_friction_ellipse_and_rest_with_the_command(
        two in path::<2>(8), three in path::<3>(6), eight in path::<8>(4),
        lever in alike::<8>(), unit in alike::<8>(),
    ) {
        let [a, b, c, ..] = lever;
        let [d, e, f, ..] = unit;
        check_vector(&transmission([0, 0], [a, b], [d, e]), &two)?;
        check_vector(&transmission([2, 2, 1], [a, b, c], [d, e, f]), &three)?;
        check_vector(&transmission([1, 1, 1], [a, b, c], [d, e, f]), &three)?;
        check_vector(&transmission([0, 1, 1, 3, 0, 0, 7, 5], lever, unit), &eight)?;
    }

    #[test]
    fn one_dof_of_a_group_that_moves_alone_is_a_scalar_play(
        points in path::<1>(8), dof in 0..3_usize, lever in alike::<3>(), unit in alike::<3>(),
    ) {
        check_one_moves(&transmission([0, 0, 0], lever, unit), dof, &points)?;
        let ([a, b, _], [c, d, _]) = (lever, unit);
        check_one_moves(&transmission([1, 1], [a, b], [c, d]), dof % 2, &points)?;
    }

    /// The error of a motion is of second order: in one step or in many, it ends alike.
    #[test]
    fn a_straight_motion_may_be_divided(
        before in path::<3>(4), motion in prop::array::uniform3(-1.0..1.0_f64), size in 1e-3..0.1_f64,
        lever in sizes::<3>(), unit in sizes::<3>(),
    ) {
        let transmission = transmission([0, 0, 0], lever, unit);
        let mut plays = Plays::REST;
        for command in commands(&before, TICK) {
            transmission.advance(&mut plays, &command);
        }
        let to = |share: f64| {
            core::array::from_fn(|dof| plays.command[dof] + share * size * motion[dof])
        };
        let (mut whole, mut divided) = (plays, plays);
        transmission.advance(&mut whole, &to(1.0));
        for part in 1..=32 {
            transmission.advance(&mut divided, &to(f64::from(part) / 32.0));
        }
        let radii = all_radii(&transmission);
        let narrowest = radii.iter().flat_map(|radii| &radii[..SHARED]);
        let narrowest = narrowest.copied().fold(f64::INFINITY, f64::min);
        let order = size / narrowest;
        let apart = apart(&transmission, &whole, &divided);
        prop_assert!(apart <= 4.0 * order * order + 1e-6, "{apart} {order}");
    }

    /// Small steps approach the exact vector play of two DOFs.
    #[test]
    fn two_dofs_follow_the_exact_vector_play(
        points in path::<2>(8), lever in sizes::<2>(), unit in sizes::<2>(),
    ) {
        let transmission = transmission([0, 0], lever, unit);
        let radii = all_radii(&transmission);
        let step = 0.01;
        let (mut plays, mut exact) = (Plays::REST, [[0.0; 2]; SHARED]);
        for command in commands(&points, step) {
            let motion = [0, 1].map(|dof| command[dof] - plays.command[dof]);
            transmission.advance(&mut plays, &command);
            let outputs = outputs(&plays);
            for (index, exact) in exact.iter_mut().enumerate() {
                let half = [radii[0][index], radii[1][index]];
                let surface = [lever[0] * unit[0] * half[0], lever[1] * unit[1] * half[1]];
                *exact = slide(*exact, [motion[0] / half[0], motion[1] / half[1]], surface[0] / surface[1]);
                for dof in 0..2 {
                    let found = (command[dof] - outputs[dof][index]) / half[dof];
                    let tolerance = 1.5 * step / half[0].min(half[1]) + 1e-6;
                    prop_assert!((found - exact[dof]).abs() <= tolerance, "{found} {exact:?} {half:?}");
                }
            }
        }
    }
}

#[test]
fn units_and_groups_out_of_range_are_named() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = Transmission::new(Friction::independent(), [1.0, bad]).unwrap_err();
        assert_eq!(error.field, "expected_width");
        assert_eq!(
            Friction::new([0, 0], [bad, 1.0]).unwrap_err().field,
            "lever"
        );
    }
    assert_eq!(
        Friction::new([0, 2], [1.0; 2]).unwrap_err().field,
        "friction"
    );
}
