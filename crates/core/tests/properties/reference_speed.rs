//! The speed limit of the reference gate: a quick reference is followed at the limit, and its lag goes with its motion.

use std::f64::consts::TAU;

use crate::article::play::Play;
use crate::r#loop::any_loop::Loop as _;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reference_gate::ReferenceGate;
use crate::supervision::settings::SafetySettings;
use proptest::prelude::*;

use super::config;
use super::support::loops::article_with;
use super::support::{PERIOD, UNITS, dofs, safety};

const FAST: Flags = Flags::of(Flag::ReferenceFast);

/// A gate whose input moves one DOF, and what it has let pass, in units.
struct Bench {
    gate: ReferenceGate<3>,
    dof: usize,
    tick: u32,
    input: f64,
    /// The travels of input and gated reference.
    travels: [f64; 2],
    /// The gated increments since the start.
    passed: Vec<f64>,
}

/// An increment of the input, and what the gate made of it, in units.
struct Step {
    increment: f64,
    passed: f64,
    raised: Flags,
}

impl Bench {
    fn new(dof: usize) -> Self {
        Self::with(&safety(), dof)
    }

    fn with(settings: &SafetySettings, dof: usize) -> Self {
        let mut gate = ReferenceGate::new(settings, &dofs(), PERIOD).unwrap();
        gate.step([0.0; 3], 0.0, None, false, Flags::NONE);
        Self {
            gate,
            dof,
            tick: 0,
            input: 0.0,
            travels: [0.0; 2],
            passed: Vec::new(),
        }
    }

    /// A tick in which the input moves; jumps pass, also after a rest.
    fn go(&mut self, by: f64) -> Step {
        self.go_with(
            by,
            Flags::of(Flag::ReferenceJump).union(Flags::of(Flag::ReferenceLate)),
        )
    }

    fn go_with(&mut self, by: f64, off: Flags) -> Step {
        let before = self.input;
        self.tick += 1;
        self.input += by * UNITS[self.dof];
        let mut reference = [0.0; 3];
        reference[self.dof] = self.input;
        let time = f64::from(self.tick) * PERIOD;
        let gated = self.gate.step(reference, time, None, false, off);
        let step = Step {
            increment: (self.input - before) / UNITS[self.dof],
            passed: gated.increments[self.dof] / UNITS[self.dof],
            raised: gated.raised,
        };
        self.travels[0] += step.increment.abs();
        self.travels[1] += step.passed.abs();
        self.passed.push(step.passed);
        step
    }

    /// Input minus gated reference.
    fn lag(&self) -> f64 {
        (self.input - self.gate.reference()[self.dof]) / UNITS[self.dof]
    }

    /// The mean of the gated speed over `reference_time`, in `reference_speed`, as a sum over all ticks.
    fn mean_speed(&self) -> f64 {
        let share = PERIOD / safety().reference_time;
        let ages = (0_u32..).map(|ago| (-share * f64::from(ago)).exp());
        let sum: f64 = self
            .passed
            .iter()
            .rev()
            .zip(ages)
            .map(|(du, k)| du * k)
            .sum();
        sum * -(-share).exp_m1()
    }
}

/// Increments in units: ordinary, quick, at rest.
fn increments() -> impl Strategy<Value = Vec<f64>> {
    let runs = prop_oneof![
        3 => (-1.0..1.0, 1..20_usize),
        3 => (-4.0..4.0, 1..60_usize),
        2 => (Just(0.0), 1..20_usize),
        1 => (-40.0..40.0, 1..3_usize),
    ];
    prop::collection::vec(runs, 1..12).prop_map(|runs| {
        runs.iter()
            .flat_map(|&(by, ticks)| vec![by; ticks])
            .collect()
    })
}

proptest! {
    #![proptest_config(config())]

    /// At rest with the input to the bit; 0 <= dg / du <= 2; within both limits.
    #[test]
    fn any_input_is_followed_in_its_direction_within_the_limits(increments in increments(), dof in 0..3_usize) {
        let mut bench = Bench::new(dof);
        let mut repeated = 0.0;
        for by in increments {
            let step = bench.go(by);
            repeated += 1.0;
            if step.increment == 0.0 {
                prop_assert_eq!(step.passed, 0.0);
                continue;
            }
            let ratio = step.passed / step.increment;
            prop_assert!((0.0..=2.0 + 1e-9).contains(&ratio), "{}", ratio);
            prop_assert!(bench.mean_speed().abs() <= 1.0 + 1e-9, "{}", bench.mean_speed());
            // `command_speed` is five units in a tick, and the gain five.
            prop_assert!(step.passed.abs() <= repeated + 1e-9, "{}", step.passed);
            repeated = 0.0;
        }
    }

    /// The lag falls by the travel of the input, in either direction, unless a limit binds; this is said, and only this.
    #[test]
    fn the_lag_grows_only_where_a_limit_binds_and_falls_by_the_travel(increments in increments(), dof in 0..3_usize) {
        let mut bench = Bench::new(dof);
        for by in increments {
            let before = bench.lag();
            let step = bench.go(by);
            // Towards the lag the rest of it stays; away from it, an input beyond its old place takes the gate with it.
            let expected = (before.abs() - step.increment.abs()).max(0.0);
            let more = bench.lag().abs() - expected;
            prop_assert!(more >= -1e-9, "{}", more);
            prop_assert_eq!(more > 1e-9, step.raised == FAST, "{} {:?}", more, step.raised);
            let [input, gated] = bench.travels;
            prop_assert!(gated + bench.lag().abs() <= input + 1e-9);
        }
    }

    /// After a flick the gated reference returns to the input, to the bit, and as the input moves.
    #[test]
    fn after_a_flick_the_gated_reference_returns_to_the_input(
        speed in 1.5..4.0, ticks in 30..100_u32, slow in 0.1..0.5, side in prop::sample::select(&[-1.0, 1.0])
    ) {
        let mut bench = Bench::new(0);
        for _ in 0..ticks {
            bench.go(speed);
        }
        let lag = bench.lag();
        prop_assert!(lag > 1.0);
        for _ in 0..100 {
            prop_assert_eq!(bench.go(0.0).passed, 0.0);
        }
        prop_assert_eq!(bench.lag(), lag);
        let mut travel = 0.0;
        while travel + 1e-9 < lag {
            prop_assert_ne!(bench.gate.reference()[0], bench.input);
            let step = bench.go(side * slow);
            prop_assert_eq!(step.raised, Flags::NONE);
            travel += slow;
        }
        for _ in 0..50 {
            bench.go(side * slow);
            prop_assert_eq!(bench.gate.reference()[0], bench.input);
        }
    }
}

#[test]
fn a_steady_input_above_the_limit_is_followed_at_the_limit_and_this_is_said() {
    for dof in 0..3 {
        for ratio in [1.0 - 1e-8, 1.001, 1.5, 3.0, 30.0] {
            let mut bench = Bench::new(dof);
            let mut raised = Flags::NONE;
            for _ in 0..2000 {
                raised = bench.go(ratio).raised;
            }
            assert_eq!(raised, Flags::when(ratio > 1.0, Flag::ReferenceFast));
            let speed = bench.passed.last().unwrap();
            assert!((speed - ratio.min(1.0)).abs() < 1e-6, "{ratio}: {speed}");
        }
    }
}

/// Of a burst from rest, what `reference_speed` makes of `reference_time` passes at once where `command_speed` permits.
#[test]
fn a_burst_is_followed_as_far_as_its_speed_limit_allows_and_no_farther() {
    let settings = SafetySettings {
        command_speed: [1e3; 3],
        ..safety()
    };
    let farthest = 1.0 / (1.0 - libm::exp(-PERIOD / settings.reference_time));
    for dof in 0..3 {
        for (share, raised) in [(1.0 - 1e-9, false), (1.01, true), (-1.01, true)] {
            let step = Bench::with(&settings, dof).go(farthest * share);
            assert_eq!(step.raised, Flags::when(raised, Flag::ReferenceFast));
            let passed = farthest * share.clamp(-1.0, 1.0);
            assert!((step.passed - passed).abs() < 1e-9, "{dof}, {share}");
        }
    }
}

/// In the slack the command moves five times as fast as the reference.
#[test]
fn no_reference_that_is_followed_makes_the_command_exceed_its_speed() {
    for speed in [1.5, 1.7, 3.0] {
        let settings = SafetySettings {
            off: Flags::of(Flag::ReferenceJump).union(Flags::of(Flag::ReferenceLate)),
            ..safety()
        };
        let mut reduction = article_with(&settings, 0.0, |unit| {
            Play::new(-12.0 * unit, 12.0 * unit).unwrap()
        });
        let (mut time, mut input, mut flags) = (0.0, 0.0, Flags::NONE);
        for tick in 0..2000 {
            let side = if (tick / 17) % 2 == 0 { 1.0 } else { -1.0 };
            input += side * speed;
            time += PERIOD;
            reduction.step(UNITS.map(|unit| input * unit), None, time);
            flags = flags.union(reduction.supervision().flags);
        }
        assert!(flags.contains(Flag::ReferenceFast));
        assert!(!flags.contains(Flag::CommandJump), "{speed}");
    }
}

#[test]
fn a_device_slower_than_the_loop_is_limited_by_its_speed() {
    let mut bench = Bench::new(0);
    for tick in 0..600 {
        let by = if tick % 6 == 5 { 3.0 } else { 0.0 };
        let step = bench.go(by);
        assert_eq!((step.passed, step.raised), (step.increment, Flags::NONE));
    }
}

#[test]
fn a_jump_stops_motion_and_is_no_fast_reference() {
    for by in [1.2, -1.2, 10.0] {
        let mut bench = Bench::new(1);
        let step = bench.go_with(by, Flags::NONE);
        assert_eq!(step.raised, Flags::of(Flag::ReferenceJump));
        assert_eq!(step.passed, 0.0);
        let next = bench.go_with(0.1, Flags::NONE);
        assert!((next.passed - 0.1).abs() < 1e-9, "nothing catches up");
    }
}

/// And the motion before: a burst passes as one from rest.
#[test]
fn a_lag_is_discarded_where_motion_is_held() {
    let settings = SafetySettings {
        command_speed: [1e3; 3],
        ..safety()
    };
    let farthest = 1.0 / (1.0 - libm::exp(-PERIOD / settings.reference_time));
    let mut bench = Bench::with(&settings, 0);
    for _ in 0..100 {
        bench.go(2.0);
    }
    assert!(bench.lag() > 10.0);
    let at = bench.gate.reference();
    bench.tick += 1;
    let (input, time) = (bench.input, f64::from(bench.tick) * PERIOD);
    let held = bench
        .gate
        .step([input, 0.0, 0.0], time, None, true, Flags::NONE);
    assert_eq!(held.reference, Some(at));
    for by in [farthest * (1.0 - 1e-9), 0.2, 0.2, -0.2] {
        let step = bench.go(by);
        assert_eq!(step.raised, Flags::NONE);
        assert!((step.passed - by).abs() < 1e-9, "nothing catches up");
    }
}

#[test]
fn without_its_detector_a_fast_reference_passes() {
    let mut bench = Bench::new(0);
    let off = Flags::of(Flag::ReferenceJump).union(FAST);
    for _ in 0..100 {
        let step = bench.go_with(5.0, off);
        assert_eq!((step.passed, step.raised), (step.increment, Flags::NONE));
    }
}

#[test]
fn a_tremor_is_not_too_fast() {
    let mut gate = ReferenceGate::new(&safety(), &dofs(), PERIOD).unwrap();
    for tick in 0..4000 {
        let time = f64::from(tick) * PERIOD;
        let shake = 1e-3 * time.min(1.0) * (TAU * 12.0 * time).sin();
        let gated = gate.step([shake, 0.0, 0.0], time, None, false, Flags::NONE);
        assert_eq!(gated.raised, Flags::NONE, "tick {tick}");
        assert_eq!(gated.reference, Some([shake, 0.0, 0.0]));
    }
}
