//! Supervision of 1, 2, 5 and 8 DOFs, in friction groups of 1, 2 and 3.

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::play::{Play, PlayState};
use crate::article::play_limit::PlayLimit;
use crate::dof::Friction;
use crate::r#loop::paper::{Paper, StateEstimation};
use crate::supervision::command_limiter::{CommandLimiters, LimiterResult};
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::input_device::InputDeviceMonitor;
use crate::supervision::monitors::{Law, Monitors};
use crate::supervision::motion_monitor::MotionMonitor;
use crate::supervision::prediction_monitor::PredictionMonitor;
use crate::supervision::reactions::Reaction;
use crate::supervision::reference_gate::ReferenceGate;
use proptest::prelude::*;

use super::config;
use super::support::{PERIOD, dofs_in, safety_in};
use crate::supervision::settings::SafetySettings;

type Checked = Result<(), TestCaseError>;

/// Units of the DOFs: far apart, as m and rad are.
fn units<const N: usize>() -> [f64; N] {
    core::array::from_fn(|dof| [0.4e-3, 0.04, 0.02, 1.0, 7e-3, 0.3, 0.1, 2e-3][dof])
}

/// Numbers of a tick for up to 8 DOFs.
fn numbers(each: impl Strategy<Value = f64>) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(each, 8)
}

/// These numbers in [`units`].
fn scaled<const N: usize>(numbers: &[f64]) -> [f64; N] {
    let units = units::<N>();
    core::array::from_fn(|dof| numbers[dof] * units[dof])
}

fn plus<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    core::array::from_fn(|dof| a[dof] + b[dof])
}

fn minus<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    core::array::from_fn(|dof| a[dof] - b[dof])
}

/// Travel of a DOF in a tick: often none, mostly little.
fn travel(most: f64) -> impl Strategy<Value = f64> {
    prop_oneof![2 => Just(0.0), 6 => -most..most, 1 => -1e-9..1e-9]
}

/// A command by what it moves, in the bound of its DOF: lawful or wild.
fn motion() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -1.0..1.0, 4 => -6.0..6.0, 2 => -300.0..300.0, 1 => any::<f64>(), 1 => Just(f64::NAN)]
}

fn limiters<const N: usize>(group: [usize; N], gain_limit: f64) -> CommandLimiters<N> {
    let friction = Friction::new(group, [1.0; N]).unwrap();
    CommandLimiters::new(&safety_in(units()), [gain_limit; N], PERIOD, friction).unwrap()
}

/// Length of a motion over the DOFs of a group, in `width_limit`.
fn length<const N: usize>(motion: [f64; N], members: [bool; N]) -> f64 {
    let width = safety_in(units::<N>()).width_limit;
    let own = (0..N).filter(|dof| members[*dof]);
    own.map(|dof| motion[dof] / width[dof])
        .fold(0.0, f64::hypot)
}

/// Whatever a law proposes: the bound of each group, speed and travel of each DOF, and rest.
fn limiter_keeps_its_bounds<const N: usize>(
    group: [usize; N],
    gain: f64,
    ticks: &[(Vec<f64>, Vec<f64>)],
) -> Checked {
    let (mut limiters, friction) = (
        limiters(group, gain),
        Friction::new(group, [1.0; N]).unwrap(),
    );
    let safety = safety_in(units::<N>());
    let (mut reference, mut command) = ([0.0; N], [0.0; N]);
    limiters.limit(reference, command);
    for (travel, motion) in ticks {
        let next = plus(reference, scaled(travel));
        let proposed = plus(command, scaled(motion));
        let (limited, results) = limiters.limit(next, proposed);
        let (du, dc) = (minus(next, reference), minus(limited, command));
        for dof in 0..N {
            let facts = format!(
                "DOF {dof} of {N}: {} for {}, {:?}",
                dc[dof], du[dof], results[dof]
            );
            let rounding = 1e-12 * safety.command_travel[dof].1;
            let (least, largest) = safety.command_travel[dof];
            prop_assert!(limited[dof].is_finite(), "{facts}");
            prop_assert!(
                dc[dof].abs() <= safety.command_speed[dof] * PERIOD + rounding,
                "{facts}"
            );
            prop_assert!((least..=largest).contains(&limited[dof]), "{facts}");
            let lead = (limited[dof] - next[dof]).abs();
            let allowed = (command[dof] - reference[dof])
                .abs()
                .max(safety.width_limit[dof]);
            prop_assert!(lead <= allowed + du[dof].abs() + rounding, "{facts}");
            let is_unchanged = results[dof] == LimiterResult::Unchanged;
            prop_assert!(!is_unchanged || limited[dof] == proposed[dof], "{facts}");
            let members = friction.members(group[dof]);
            let (moved, pulled) = (length(dc, members), length(du, members));
            prop_assert!(
                moved <= gain * pulled * (1.0 + 1e-9) + 1e-12,
                "{facts}: {moved} for {pulled}"
            );
            if pulled == 0.0 {
                prop_assert_eq!(dc[dof], 0.0, "{}", facts);
            }
            if members.iter().filter(|own| **own).count() == 1 {
                prop_assert!(dc[dof] * du[dof] >= 0.0, "{facts}");
            }
        }
        (reference, command) = (next, limited);
    }
    Ok(())
}

/// A command within the bounds passes bit for bit.
fn limiter_passes_what_keeps_the_law<const N: usize>(
    group: [usize; N],
    ticks: &[(Vec<f64>, Vec<f64>)],
) -> Checked {
    let mut limiters = limiters(group, 5.0);
    let friction = Friction::new(group, [1.0; N]).unwrap();
    let (mut reference, mut command) = ([0.0; N], [0.0; N]);
    limiters.limit(reference, command);
    for (travel, motion) in ticks {
        let next = plus(reference, scaled(travel));
        let du = minus(next, reference);
        let mut proposed = command;
        for dof in 0..N {
            let members = friction.members(group[dof]);
            let alone = members.iter().filter(|own| **own).count() == 1;
            // As far beyond the reference as `width_limit` allows, and back.
            let lead = 20.0 * units::<N>()[dof] * motion[dof].clamp(-1.0, 1.0);
            let wanted = next[dof] + lead - command[dof];
            proposed[dof] += if alone {
                wanted.clamp((4.9 * du[dof]).min(0.0), (4.9 * du[dof]).max(0.0))
            } else {
                let share = 4.9 / 3.0_f64.sqrt() * length(du, members);
                let most = share * safety_in(units::<N>()).width_limit[dof];
                wanted.clamp(-most, most)
            };
        }
        let limits = safety_in(units::<N>()).command_speed;
        let is_slow =
            (0..N).all(|dof| (proposed[dof] - command[dof]).abs() < 0.99 * limits[dof] * PERIOD);
        if is_slow {
            let found = limiters.limit(next, proposed);
            prop_assert_eq!(found, (proposed, [LimiterResult::Unchanged; N]));
            (reference, command) = (next, proposed);
        }
    }
    Ok(())
}

/// What is checked in each DOF by itself is as N monitors of one DOF have it, to the last bit.
fn n_dofs_are_n_times_one<const N: usize>(ticks: &[(Vec<f64>, Vec<f64>)]) -> Checked {
    let (safety, dofs) = (safety_in(units::<N>()), dofs_in(units::<N>()));
    let one = units::<N>().map(|unit| (safety_in([unit]), dofs_in([unit])));
    let mut gate = ReferenceGate::new(&safety, &dofs, PERIOD).unwrap();
    let mut gates = one.map(|(safety, dofs)| ReferenceGate::new(&safety, &dofs, PERIOD).unwrap());
    let mut device = InputDeviceMonitor::new(&safety, PERIOD).unwrap();
    let mut devices = one.map(|(safety, _)| InputDeviceMonitor::new(&safety, PERIOD).unwrap());
    let mut motion = MotionMonitor::new(&safety, &dofs, PERIOD).unwrap();
    let mut motions = one.map(|(safety, dofs)| MotionMonitor::new(&safety, &dofs, PERIOD).unwrap());
    let mut prediction = PredictionMonitor::new([0.2; N], units());
    let mut predictions = units::<N>().map(|unit| PredictionMonitor::new([0.2], [unit]));
    let no_jumps = Flags::of(Flag::ReferenceJump).union(Flags::of(Flag::ReferenceLate));
    let play = Play::new(-1e-4, 1e-4).unwrap();
    let (mut reference, mut time) = ([0.0; N], 0.0);
    for (travel, error) in ticks {
        let increments = scaled(travel);
        reference = plus(reference, increments);
        time += PERIOD;
        let tip = plus(reference, scaled(error));
        let gated = gate.step(reference, time, None, false, no_jumps);
        let found = [
            gated.raised,
            device.update(increments, PERIOD),
            motion.update_reference(reference),
            motion.update_measurement(time, reference, tip, [play; N]),
            Flags::when(prediction.update(time, reference, tip), Flag::SlackChanged),
        ];
        let mut expected = [Flags::NONE; 5];
        for dof in 0..N {
            let (reference, tip) = (reference[dof], tip[dof]);
            let alone = gates[dof].step([reference], time, None, false, no_jumps);
            prop_assert_eq!(
                gated.increments[dof].to_bits(),
                alone.increments[0].to_bits()
            );
            prop_assert_eq!(
                gated.reference.unwrap()[dof].to_bits(),
                alone.reference.unwrap()[0].to_bits()
            );
            let raised = [
                alone.raised,
                devices[dof].update([increments[dof]], PERIOD),
                motions[dof].update_reference([reference]),
                motions[dof].update_measurement(time, [reference], [tip], [play]),
                Flags::when(
                    predictions[dof].update(time, [reference], [tip]),
                    Flag::SlackChanged,
                ),
            ];
            expected = core::array::from_fn(|index| expected[index].union(raised[index]));
        }
        prop_assert_eq!(found, expected);
    }
    Ok(())
}

type Article<const N: usize> = Paper<N, Measured>;

struct Measured;

impl<const N: usize> StateEstimation<N> for Measured {}

fn supervised<const N: usize>(group: [usize; N], half_width: f64) -> (Monitors<N>, Article<N>) {
    let mut dofs = dofs_in(units::<N>());
    for (dof, unit) in dofs.iter_mut().zip(units::<N>()) {
        (dof.delta_minus, dof.delta_plus) = (-half_width * unit, half_width * unit);
    }
    let limiters = limiters(group, dofs[0].gain_limit);
    let safety = SafetySettings {
        off: Flags::of(Flag::Dropped),
        ..safety_in(units())
    };
    let monitors = Monitors::new(&safety, &dofs, PERIOD, limiters).unwrap();
    let law = Article::with_estimation(&dofs, monitors.play_limits(), Measured).unwrap();
    (monitors, law)
}

/// While nothing is wrong, supervision changes no bit of the law.
fn supervision_is_transparent<const N: usize>(group: [usize; N]) {
    let (mut monitors, mut law) = supervised(group, 5.0);
    let mut alone = units::<N>().map(|unit| {
        let play = Play::new(-5.0 * unit, 5.0 * unit).unwrap();
        (
            Compensator::new(5.0, 5.0).unwrap(),
            CompensatorState::new(play),
        )
    });
    for tick in 0..2000_u32 {
        let reference: [f64; N] = core::array::from_fn(|dof| {
            let speed = 0.004 + 0.0007 * f64::from(u8::try_from(dof).unwrap());
            12.0 * units::<N>()[dof] * (speed * f64::from(tick)).sin()
        });
        monitors.step(
            &mut law,
            reference,
            None,
            PERIOD * f64::from(tick),
            |_, command| command,
        );
        assert_eq!(
            monitors.supervision().latched,
            Flags::NONE,
            "{N}, tick {tick}"
        );
        let expected: [f64; N] = core::array::from_fn(|dof| {
            let (compensator, state) = &mut alone[dof];
            compensator.step(state, reference[dof])
        });
        assert_eq!(
            law.command().map(f64::to_bits),
            expected.map(f64::to_bits),
            "{N}, tick {tick}"
        );
    }
}

/// What is wrong in one DOF stops all; a new engagement moves nothing.
fn one_dof_stops_all<const N: usize>(group: [usize; N]) {
    for wrong in 0..N {
        for value in [f64::NAN, 100.0 * units::<N>()[wrong]] {
            let (mut monitors, mut law) = supervised(group, 5.0);
            let mut time = 0.0;
            let mut go = |monitors: &mut Monitors<N>, law: &mut Article<N>, reference| {
                time += PERIOD;
                monitors.step(law, reference, None, time, |_, command| command);
                (law.command(), monitors.supervision().reaction)
            };
            let moved = |by: f64| units::<N>().map(|unit| by * unit);
            go(&mut monitors, &mut law, moved(0.0));
            let (stopped, _) = go(&mut monitors, &mut law, moved(0.5));
            let mut bad = moved(1.0);
            bad[wrong] = value;
            for reference in [bad, moved(1.5), moved(2.0)] {
                assert_eq!(
                    go(&mut monitors, &mut law, reference),
                    (stopped, Reaction::HoldMotion)
                );
            }
            monitors.engage();
            assert_eq!(
                go(&mut monitors, &mut law, moved(2.5)),
                (stopped, Reaction::None)
            );
            let (on, _) = go(&mut monitors, &mut law, moved(3.0));
            assert!((0..N).all(|dof| on[dof] > stopped[dof]), "{N}, {wrong}");
        }
    }
}

/// The compensation fades with the travel of all DOFs, each in its `width_limit`.
fn fading_takes_the_travel_of_all<const N: usize>(group: [usize; N]) {
    let (mut monitors, mut law) = supervised(group, 5.0);
    monitors.step(&mut law, [0.0; N], None, 0.0, |_, command| command);
    monitors.raise(Flag::LimitCycle);
    monitors.step(
        &mut law,
        units().map(|unit: f64| 0.3 * unit),
        None,
        PERIOD,
        |_, command| command,
    );
    let travel: f64 = (0..N).map(|_| 0.3 / 30.0).sum();
    let share = monitors.supervision().lead;
    assert!((share - (1.0 - travel / 2.0)).abs() < 1e-12, "{N}: {share}");
}

/// The tip of an observed DOF follows, whatever the others do; without images of it nothing is compensated.
fn offsets_converge_where_observed<const N: usize>() {
    let dofs = dofs_in(units::<N>());
    let mut law = Article::with_estimation(&dofs, [PlayLimit::NONE; N], Measured).unwrap();
    let plays = units::<N>().map(|unit| Play::new(-4.0 * unit, 6.0 * unit).unwrap());
    let mut tips = [PlayState { output: 0.0 }; N];
    let observed = core::array::from_fn(|dof| dof != 2);
    let mut worst = [0.0_f64; N];
    for tick in 0..20_000_u32 {
        let reference: [f64; N] = core::array::from_fn(|dof| {
            let speed = 0.002 + 0.0003 * f64::from(u8::try_from(dof).unwrap());
            15.0 * units::<N>()[dof] * (speed * f64::from(tick)).sin()
        });
        let command = law.propose(reference);
        law.commit(command);
        let state = core::array::from_fn(|dof| plays[dof].step(&mut tips[dof], command[dof]));
        law.update_offsets(command, state, observed);
        if tick > 15_000 {
            worst = core::array::from_fn(|dof| worst[dof].max((state[dof] - reference[dof]).abs()));
        }
    }
    for (dof, unit) in units::<N>().into_iter().enumerate() {
        // A gain of 5 leaves a fifth of the offset.
        let bounds = if observed[dof] { 1.1..1.4 } else { 5.9..6.1 };
        let error = worst[dof] / unit;
        assert!(bounds.contains(&error), "DOF {dof} of {N}: {error}");
    }
}

#[test]
fn supervision_of_n_dofs() {
    supervision_is_transparent([0]);
    supervision_is_transparent([0, 0]);
    supervision_is_transparent([1, 1, 1, 3, 4]);
    supervision_is_transparent([0, 0, 2, 2, 2, 5, 7, 7]);
    one_dof_stops_all([0]);
    one_dof_stops_all([1, 1]);
    one_dof_stops_all([1, 1, 1, 3, 4]);
    one_dof_stops_all([0, 0, 2, 2, 2, 5, 7, 7]);
    fading_takes_the_travel_of_all([0]);
    fading_takes_the_travel_of_all([0, 0]);
    fading_takes_the_travel_of_all([1, 1, 1, 3, 4]);
    fading_takes_the_travel_of_all([0, 0, 2, 2, 2, 5, 7, 7]);
}

#[test]
fn the_article_scheme_estimates_n_dofs() {
    offsets_converge_where_observed::<1>();
    offsets_converge_where_observed::<2>();
    offsets_converge_where_observed::<5>();
    offsets_converge_where_observed::<8>();
}

/// Without gain, the motion of the reference takes all of the common bound.
#[test]
fn a_gain_of_one_leaves_the_motion_of_the_reference() {
    let mut limiters = limiters([0, 0, 0], 1.0);
    limiters.limit([0.0; 3], [0.0; 3]);
    let [unit, side, third] = units::<3>();
    let (command, results) = limiters.limit([unit, 0.0, 0.0], [unit, 0.3 * side, -0.1 * third]);
    assert!((command[0] - unit).abs() < 1e-12 * unit, "{command:?}");
    assert_eq!((command[1], command[2]), (0.0, 0.0));
    assert_eq!(results, [LimiterResult::Violation; 3]);
}

/// Positions that are rounded move by the bound and a few parts in 10^16 of a unit: for a motion of a nanometre, more than
/// any share of it.
#[test]
fn a_slow_motion_at_the_bound_is_lawful_in_spite_of_rounding() {
    let mut limiters = limiters([0, 0, 0], 1.0);
    let [unit, side, _] = units::<3>();
    limiters.limit([unit, side, 0.0], [unit, side, 0.0]);
    let to = unit + 1e-7 * unit;
    let (command, results) = limiters.limit([to, side, 0.0], [to, side + 1e-11 * side, 0.0]);
    assert_eq!(results, [LimiterResult::Unchanged; 3], "{command:?}");
    let farther = unit + (2e-7 + 1e-15) * unit;
    let (_, results) = limiters.limit([unit + 2e-7 * unit, side, 0.0], [farther, side, 0.0]);
    assert_eq!(results, [LimiterResult::Unchanged; 3]);
    let (_, results) = limiters.limit(
        [unit + 3e-7 * unit, side, 0.0],
        [farther + 2e-7 * unit, side, 0.0],
    );
    assert_eq!(results, [LimiterResult::Violation; 3]);
}

#[test]
fn a_friction_is_checked() {
    let error = |group, lever| Friction::new(group, lever).unwrap_err();
    assert_eq!(error([0, 2], [1.0, 1.0]).field, "friction");
    assert_eq!(error([0, 0], [1.0, 0.0]).field, "lever");
    let shaft = Friction::new([0, 0, 2], [1.0, 2e-3, 1.0]).unwrap();
    assert_eq!(shaft.members(0), [true, true, false]);
    assert_eq!(
        (shaft.group(), shaft.lever()),
        ([0, 0, 2], [1.0, 2e-3, 1.0])
    );
    assert_eq!(Friction::<3>::independent().group(), [0, 1, 2]);
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn command_limiters_keep_their_bounds(
        ticks in prop::collection::vec((numbers(travel(1.0)), numbers(motion())), 1..60),
        gain in prop_oneof![Just(1.0), 1.0..5.0, Just(5.0)],
    ) {
        limiter_keeps_its_bounds([0], gain, &ticks)?;
        limiter_keeps_its_bounds([0, 0], gain, &ticks)?;
        limiter_keeps_its_bounds([1, 1, 1, 3, 4], gain, &ticks)?;
        limiter_keeps_its_bounds([0, 0, 2, 2, 2, 5, 7, 7], gain, &ticks)?;
    }

    #[test]
    fn command_limiters_pass_what_keeps_the_law(
        ticks in prop::collection::vec((numbers(travel(0.5)), numbers(-1.0..1.0)), 1..60),
    ) {
        limiter_passes_what_keeps_the_law([0], &ticks)?;
        limiter_passes_what_keeps_the_law([0, 0], &ticks)?;
        limiter_passes_what_keeps_the_law([1, 1, 1, 3, 4], &ticks)?;
        limiter_passes_what_keeps_the_law([0, 0, 2, 2, 2, 5, 7, 7], &ticks)?;
    }

    #[test]
    fn monitors_of_n_dofs_are_n_monitors(
        ticks in prop::collection::vec((numbers(travel(3.0)), numbers(-1.0..1.0)), 1..60),
    ) {
        n_dofs_are_n_times_one::<1>(&ticks)?;
        n_dofs_are_n_times_one::<2>(&ticks)?;
        n_dofs_are_n_times_one::<5>(&ticks)?;
        n_dofs_are_n_times_one::<8>(&ticks)?;
    }
}
