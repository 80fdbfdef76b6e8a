//! What the control law guarantees, over as many random steps as `TAUTSCOPE_STEPS` says; a million without it.
//!
//! `benchmarks/guarantees` runs these over 1e9 and reads what they print.

use crate::adaptive::vector_law::VectorLaw;
use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::play::{Play, PlayState};
use crate::article::play_limit::PlayLimit;
use crate::dof::PerDof;
use crate::estimation::ensemble::ScalarMeasurement;
use crate::estimation::filter::Filter;
use crate::supervision::flags::Flag;
use crate::supervision::monitors::{Law, Monitors};

use super::support::{PERIOD, UNITS, dofs, safety, settings};

const LIMIT: f64 = 5.0;

fn steps() -> u64 {
    let wanted = std::env::var("TAUTSCOPE_STEPS");
    wanted.map_or(1_000_000, |text| text.parse().unwrap())
}

/// Marsaglia's xorshift64*: quick, and the same everywhere.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, count: u64) -> u64 {
        (self.next() >> 32) % count
    }

    #[expect(clippy::cast_precision_loss, reason = "53 bits")]
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn play(&mut self) -> Play {
        let minus = self.within(-3.0, 2.0);
        let width = if self.below(8) == 0 {
            0.0
        } else {
            self.within(0.0, 3.0)
        };
        Play::new(minus, minus + width).unwrap()
    }

    /// Mostly a tick's travel, now and then none, next to none, or a jump.
    fn travel(&mut self) -> f64 {
        match self.below(16) {
            0 | 1 => 0.0,
            2 => self.within(-1.0, 1.0) * 1e-15,
            3 => self.within(-3.0, 3.0),
            _ => self.within(-0.05, 0.05),
        }
    }
}

/// How often the law was broken, and how near it came, in the last places of the numbers involved.
#[derive(Default)]
struct Count {
    steps: u64,
    gain: u64,
    still: u64,
    excess: f64,
}

impl Count {
    fn step(&mut self, increment: f64, before: f64, after: f64) {
        self.steps += 1;
        let moved = after - before;
        if increment == 0.0 {
            self.still += u64::from(before.to_bits() != after.to_bits());
            return;
        }
        let scale = before.abs().max(after.abs()).max(increment.abs());
        let excess = (moved.abs() - LIMIT * increment.abs()) / (f64::EPSILON * scale);
        self.excess = self.excess.max(excess);
        self.gain += u64::from(!(moved * increment >= 0.0 && excess <= 4.0));
    }

    /// Nothing but the reference moves the command.
    fn event(&mut self, before: f64, after: f64) {
        self.still += u64::from(before.to_bits() != after.to_bits());
    }

    fn with(&self, other: &Self) -> Self {
        Self {
            steps: self.steps + other.steps,
            gain: self.gain + other.gain,
            still: self.still + other.still,
            excess: self.excess.max(other.excess),
        }
    }

    fn report(&self, law: &str) {
        println!("G1 {law} {} {} {}", self.steps, self.gain, self.excess);
        println!("G2 {law} {} {} 0", self.steps, self.still);
        assert_eq!((self.gain, self.still), (0, 0), "{law}");
    }
}

fn walk(chance: &mut Chance, reference: f64) -> f64 {
    let next = reference + chance.travel();
    if next.abs() > 5.0 { reference } else { next }
}

#[test]
fn gain_of_the_compensator() {
    let (mut chance, mut count) = (Chance(2013), Count::default());
    let mut law = Compensator::new(LIMIT, LIMIT).unwrap();
    let mut state = CompensatorState::new(chance.play());
    let mut reference = 0.3;
    law.step(&mut state, reference);
    while count.steps < steps() {
        let before = state.command();
        match chance.below(24) {
            0 => law.retune(&mut state, chance.play()),
            1 => {
                let gain = chance.within(1.0, LIMIT);
                law = Compensator::new(gain, LIMIT).unwrap();
                law = law.with_recovery(chance.within(0.0, 0.9)).unwrap();
                let play = state.play();
                law.retune(&mut state, play);
            }
            2 => {
                law.step(&mut state, f64::NAN);
            }
            _ => {
                let next = walk(&mut chance, reference);
                law.step(&mut state, next);
                count.step(next - reference, before, state.command());
                reference = next;
                continue;
            }
        }
        count.event(before, state.command());
    }
    count.report("paper");
}

/// The vector law, with what it is asked and what it answers.
struct Watched {
    law: VectorLaw,
    filter: Filter,
    reference: PerDof<f64>,
    count: Count,
}

impl Watched {
    fn new() -> Self {
        let settings = settings(&safety());
        let unit = settings.safety.width_limit.map(|width| width / 2.0);
        let limits = [0, 1, 2].map(|dof| {
            let safety = &settings.safety;
            PlayLimit::new(safety.width_limit[dof], safety.offset_limit[dof]).unwrap()
        });
        let none = Play::new(0.0, 0.0).unwrap();
        let start = dofs().map(|dof| dof.start_deviation);
        let radius = settings.instrument.diameter / 2.0;
        Self {
            law: VectorLaw::new(
                &settings.adaptive,
                &dofs(),
                &settings.control,
                settings.safety.width_limit,
                settings.safety.command_speed,
                radius,
                limits,
            )
            .unwrap(),
            filter: Filter::new(settings.state_estimation, unit, start, [none; 3], radius).unwrap(),
            reference: [f64::NAN; 3],
            count: Count::default(),
        }
    }

    /// An image that says anything; the estimate changes as much as it can.
    fn measure(&mut self, chance: &mut Chance) {
        if !self.reference.iter().all(|value| value.is_finite()) {
            return;
        }
        let now = (self.law.command(), self.reference);
        self.filter.follow(core::iter::once(now));
        let before = self.filter.nominal().hysteresis;
        let dof = [0, 1, 2][usize::try_from(chance.below(3)).unwrap()];
        let std = UNITS[dof] * chance.within(0.1, 3.0);
        let tip = self.law.command()[dof] + UNITS[dof] * chance.within(-30.0, 30.0);
        let mut row = ScalarMeasurement {
            output: [0.0; 3],
            lag: [0.0; 3],
            geometry: [0.0; 3],
            value: tip / std,
        };
        row.output[dof] = 1.0 / std;
        let mut seen = self.law.command();
        seen[dof] = tip;
        self.filter.update_with(&[row], seen, chance.below(4) == 0);
        let after = self.filter.nominal().hysteresis;
        self.law.rate_limit_mut().update(
            [before.half_width, before.centre],
            [after.half_width, after.centre],
        );
        if chance.below(50) == 0 {
            self.filter.reset_position();
        }
    }

    /// Bounds of a tick: of the norm over insertion and rotation, of bending to the last bit, and of each speed.
    fn check(&mut self, reference: PerDof<f64>, before: PerDof<f64>) {
        let (after, last) = (self.law.command(), self.reference);
        if !reference
            .iter()
            .chain(&before)
            .all(|value| value.is_finite())
        {
            if before.iter().all(|value| value.is_finite()) {
                self.rest(before, after, &[0, 1, 2]);
            }
            return;
        }
        self.count.steps += 1;
        let width = safety().width_limit;
        let norm = |x: PerDof<f64>| (x[0] / width[0]).hypot(x[1] / width[1]);
        let minus = |a: PerDof<f64>, b: PerDof<f64>| [0, 1, 2].map(|dof| a[dof] - b[dof]);
        let (dc, du) = (minus(after, before), minus(reference, last));
        if du[0] == 0.0 && du[1] == 0.0 {
            self.rest(before, after, &[0, 1]);
        }
        let scale = [before, after, reference, last]
            .into_iter()
            .fold(f64::MIN_POSITIVE, |most, x| most.max(norm(x)));
        let excess = (norm(dc) - LIMIT * norm(du)) / (f64::EPSILON * scale);
        self.count.excess = self.count.excess.max(excess);
        let farthest = before[2] + LIMIT * du[2];
        let (low, high) = (before[2].min(farthest), before[2].max(farthest));
        let limits = safety().command_speed.map(|speed| speed * PERIOD);
        // A share of the compensation leaves the reference's own speed, which the gate limits.
        let too_fast = [0, 1, 2]
            .into_iter()
            .any(|dof| dc[dof].abs() > limits[dof].max(du[dof].abs() * (1.0 + 1e-9)));
        let within = excess <= 8.0 && (low..=high).contains(&after[2]) && !too_fast;
        self.count.gain += u64::from(!within);
        if du[2] == 0.0 {
            self.rest(before, after, &[2]);
        }
    }

    fn rest(&mut self, before: PerDof<f64>, after: PerDof<f64>, dofs: &[usize]) {
        for dof in dofs {
            self.count.event(before[*dof], after[*dof]);
        }
    }
}

impl Law for Watched {
    fn command(&self) -> PerDof<f64> {
        self.law.command()
    }

    fn step_within(
        &mut self,
        reference: PerDof<f64>,
        limit: impl FnOnce(PerDof<f64>) -> PerDof<f64>,
    ) {
        let before = self.law.command();
        self.law.step_within(reference, &mut self.filter, limit);
        self.check(reference, before);
        if reference.iter().all(|value| value.is_finite()) {
            self.reference = reference;
        }
    }

    fn shift_reference(&mut self, shift: PerDof<f64>) {
        let before = self.law.command();
        self.law.shift_reference(shift);
        for (reference, shift) in self.reference.iter_mut().zip(shift) {
            *reference += shift;
        }
        self.rest(before, self.law.command(), &[0, 1, 2]);
    }

    fn set_share(&mut self, share: f64) {
        let before = self.law.command();
        self.law.set_share(share);
        self.rest(before, self.law.command(), &[0, 1, 2]);
    }
}

/// A million steps, or as many as asked for; each core its share of them.
fn on_each_core(walk: impl Fn(u64, u64) -> Count + Sync) -> Count {
    let asked = std::env::var("TAUTSCOPE_STEPS").is_ok();
    // Unoptimised, a step takes 20 times as long.
    // Half for each of the two tests.
    let wanted = if asked || !cfg!(debug_assertions) {
        steps() / 2
    } else {
        steps() / 20
    };
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get() as u64);
    let mut count = Count::default();
    std::thread::scope(|scope| {
        let walk = &walk;
        let parts: Vec<_> = (0..cores)
            .map(|core| scope.spawn(move || walk(2026 + core, wanted.div_ceil(cores))))
            .collect();
        for part in parts {
            count = count.with(&part.join().unwrap());
        }
    });
    count
}

/// The next reference: each DOF mostly moves, and often rests.
fn moved(chance: &mut Chance, reference: PerDof<f64>) -> PerDof<f64> {
    let mut next = reference;
    for (value, unit) in next.iter_mut().zip(UNITS) {
        let place = walk(chance, *value / (10.0 * unit));
        if chance.below(3) > 0 {
            *value = place * 10.0 * unit;
        }
    }
    next
}

/// By itself, with any estimate, any share and any shift; what a limit leaves of a step is where it goes on.
#[test]
fn bounds_of_the_vector_law() {
    on_each_core(vector_walk).report("best");
}

fn vector_walk(seed: u64, wanted: u64) -> Count {
    let (mut chance, mut watched) = (Chance(seed), Watched::new());
    watched.step_within([0.0; 3], |command| command);
    while watched.count.steps < wanted {
        let reference = watched.reference;
        match chance.below(400) {
            0 | 1 => watched.measure(&mut chance),
            2 => watched.set_share([0.0, 1.0, 0.3][usize::try_from(chance.below(3)).unwrap()]),
            3 => watched.shift_reference(UNITS.map(|unit| unit * chance.within(-1.0, 1.0))),
            4 => watched.step_within([0.0, f64::NAN, 0.0], |command| command),
            _ => {
                let next = moved(&mut chance, reference);
                let part = if chance.below(10) == 0 {
                    chance.within(0.0, 1.0)
                } else {
                    1.0
                };
                let before = watched.law.command();
                watched.step_within(next, |command| {
                    let mut limited = command;
                    if part < 1.0 {
                        for (limited, before) in limited.iter_mut().zip(before) {
                            *limited = before + part * (*limited - before);
                        }
                    }
                    limited
                });
            }
        }
    }
    watched.count
}

/// Within supervision, through jumps, holds and fades: the bounds of the law, and |c - u| <= `width_limit`, but for the
/// reference's motion of one tick.
#[test]
fn bounds_of_the_supervised_vector_law() {
    on_each_core(supervised_walk).report("best");
}

fn supervised_walk(seed: u64, wanted: u64) -> Count {
    let (mut chance, mut watched) = (Chance(seed), Watched::new());
    let mut monitors = Monitors::new(&safety(), &dofs(), PERIOD, true).unwrap();
    let (mut reference, mut time, mut ticks) = ([0.0; 3], 0.0, 0);
    let mut led = [0.0_f64; 3];
    let mut speed = [0.0; 3];
    monitors.step(&mut watched, reference, None, time);
    while watched.count.steps < wanted && ticks < 4 * wanted {
        time += PERIOD;
        ticks += 1;
        match chance.below(2000) {
            0..10 => watched.measure(&mut chance),
            10 => monitors.raise(Flag::Frozen),
            11 => monitors.raise(Flag::FollowingError),
            12 => monitors.acknowledge(),
            13..100 => monitors.engage(),
            _ => {}
        }
        for (speed, unit) in speed.iter_mut().zip(UNITS) {
            if chance.below(100) == 0 {
                *speed = if chance.below(4) == 0 {
                    0.0
                } else {
                    unit * chance.within(-0.5, 0.5)
                };
            }
        }
        let mut next = reference;
        for ((next, speed), unit) in next.iter_mut().zip(speed).zip(UNITS) {
            *next = (*next + speed).clamp(-90.0 * unit, 190.0 * unit);
            if chance.below(20_000) == 0 {
                *next += 40.0 * unit * chance.within(-1.0, 1.0);
            }
        }
        monitors.step(&mut watched, next, None, time);
        reference = next;
        for (dof, limit) in safety().width_limit.into_iter().enumerate() {
            let lead = (watched.law.command()[dof] - watched.reference[dof]).abs();
            // Motion that is discarded counts from where it was.
            let discarded = UNITS[dof] * 1.001;
            watched.count.gain += u64::from(lead > led[dof].max(limit) + discarded);
            led[dof] = lead;
        }
    }
    watched.count
}

/// c - u - (1 - 1/K) p, in m, over reversals at every 1000 ticks.
#[test]
fn the_command_does_not_ratchet() {
    let law = Compensator::new(LIMIT, LIMIT).unwrap();
    let mut state = CompensatorState::new(Play::new(-4.3e-3, 5.7e-3).unwrap());
    let (mut reference, mut speed, mut worst) = (0.025, 37.1e-6, 0.0_f64);
    law.step(&mut state, reference);
    let start = state.command() - reference - (1.0 - 1.0 / LIMIT) * state.position();
    for tick in 1..=steps() {
        reference += speed;
        law.step(&mut state, reference);
        if tick % 1000 == 0 {
            speed = -speed;
        }
        let rest = state.command() - reference - (1.0 - 1.0 / LIMIT) * state.position();
        worst = worst.max((rest - start).abs());
    }
    println!(
        "G3 paper {} {} {}",
        steps(),
        u64::from(worst > 1e-12),
        1e3 * worst
    );
    assert!(worst <= 1e-12, "{worst} m");
}

/// After a reversal the tip overshoots by max(0, estimated width (1 - 1/K) - true width), in mm.
#[test]
fn overestimated_width_overshoots_by_the_formula_everywhere() {
    let (mut worst, mut cases) = (0.0_f64, 0_u64);
    let truth = Play::new(-10.0, 0.0).unwrap();
    for ratio in 0..=20 {
        for gain in 4..=20 {
            let gain = f64::from(gain) / 2.0;
            let believed = 10.0 * (1.0 + f64::from(ratio) / 20.0);
            let law = Compensator::new(gain, gain).unwrap();
            let mut state = CompensatorState::new(Play::new(-believed, 0.0).unwrap());
            let mut tip = PlayState { output: 0.0 };
            let mut go = |reference: f64| truth.step(&mut tip, law.step(&mut state, reference));
            go(0.0);
            let turned_at = go(15.0);
            let mut overshoot = 0.0_f64;
            for tick in 1..=8000 {
                let back = f64::from(tick) * 0.005;
                overshoot = overshoot.max(turned_at - go(15.0 - back) - back);
            }
            let expected = (believed * (1.0 - 1.0 / gain) - 10.0).max(0.0);
            worst = worst.max((overshoot - expected).abs());
            cases += 1;
        }
    }
    println!("G4 paper {cases} {} {worst}", u64::from(worst > 0.01));
    assert!(worst <= 0.01, "{worst} mm");
}
