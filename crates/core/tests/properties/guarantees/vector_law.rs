//! The vector law, by itself and within supervision: gain, rest, speed.

use crate::article::play_limit::PlayLimit;
use crate::dof::{Friction, PerDof};
use crate::estimation::estimate::Estimate;
use crate::estimation::measurement::Linear;
use crate::law::vector_law::{Bounds, VectorLaw};
use crate::model::plays::COEFFICIENTS;
use crate::model::slack::Slack;
use crate::supervision::command_limiter::CommandLimiters;
use crate::supervision::flags::Flag;
use crate::supervision::monitors::{Law, Monitors};
use nalgebra::{SMatrix, SVector};

use super::super::support::{PERIOD, UNITS, dofs, safety, settings};
use super::{Count, Random, steps, walk};

/// `K_b` of the law.
const LIMIT: f64 = 20.0;

/// The vector law, with the bounds checked at every call.
struct CheckedLaw {
    law: VectorLaw<3>,
    estimate: Estimate<3, 0, { 3 * COEFFICIENTS }>,
    reference: PerDof<f64>,
    /// The reference of the proposed command.
    next: PerDof<f64>,
    count: Count,
}

impl CheckedLaw {
    fn new() -> Self {
        let settings = settings(&safety());
        let transmission = settings.of_loop().unwrap().transmission().unwrap();
        let width_limit = settings.safety.width_limit;
        let bounds = Bounds {
            width_limit,
            speed: settings.safety.command_speed,
            period: PERIOD,
            input_age: settings.safety.reference_age,
            offsets: [0, 1, 2].map(|dof| {
                PlayLimit::new(width_limit[dof], settings.safety.offset_limit[dof]).unwrap()
            }),
        };
        let start = dofs().map(|dof| dof.start_deviation);
        let mut estimate = Estimate::new(
            settings.estimation,
            transmission,
            [],
            &[Slack::default(); 3],
            start,
        )
        .unwrap();
        estimate.origin = [0.0; 3];
        Self {
            law: VectorLaw::new(settings.law, transmission, &bounds).unwrap(),
            estimate,
            reference: [f64::NAN; 3],
            next: [f64::NAN; 3],
            count: Count::default(),
        }
    }

    /// A tick whose command is cut to a part of its motion.
    fn step(&mut self, reference: PerDof<f64>, part: f64) {
        let before = self.law.command;
        let mut command = self.propose(reference);
        if part < 1.0 {
            for (command, before) in command.iter_mut().zip(before) {
                *command = before + part * (*command - before);
            }
        }
        self.commit(command);
    }

    /// An image with any measurement; the estimate changes as much as it can.
    fn measure(&mut self, random: &mut Random) {
        if !self.reference.iter().all(|value| value.is_finite()) {
            return;
        }
        let dof = usize::try_from(random.below(3)).unwrap();
        let std = UNITS[dof] * random.within(0.1, 3.0);
        let tip = self.law.command[dof] + UNITS[dof] * random.within(-30.0, 30.0);
        let mut by_state = SMatrix::<f64, 1, 3>::zeros();
        by_state[dof] = 1.0 / std;
        let measurement = Linear {
            by_state,
            by_geometry: SMatrix::zeros(),
            value: SVector::from([tip / std]),
        };
        let plays = &self.law.plays;
        self.estimate.advance(plays.travel);
        self.estimate
            .update(plays, &measurement, 0.0, random.below(4) == 0);
        if random.below(50) == 0 {
            self.estimate
                .loosen(dofs().map(|dof| dof.start_deviation), [f64::INFINITY; 3]);
        }
    }

    /// Bounds of a tick: of the norm over insertion and rotation, of bending to the last bit, and of each speed.
    fn check(&mut self, reference: PerDof<f64>, before: PerDof<f64>) {
        let (after, last) = (self.law.command, self.reference);
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

impl Law<3> for CheckedLaw {
    fn command(&self) -> PerDof<f64> {
        self.law.command
    }

    fn propose(&mut self, reference: PerDof<f64>) -> PerDof<f64> {
        self.next = reference;
        self.law
            .propose(reference, &self.estimate.coefficients(), 1.0)
    }

    fn commit(&mut self, command: PerDof<f64>) {
        let before = self.law.command;
        self.law.commit(command);
        self.check(self.next, before);
        if self.next.iter().all(|value| value.is_finite()) {
            self.reference = self.next;
        }
    }

    fn shift_reference(&mut self, shift: PerDof<f64>) {
        let before = self.law.command;
        self.law.shift_reference(shift);
        for (reference, shift) in self.reference.iter_mut().zip(shift) {
            *reference += shift;
        }
        self.rest(before, self.law.command, &[0, 1, 2]);
    }

    fn set_share(&mut self, share: f64) {
        let before = self.law.command;
        self.law.share = share;
        self.rest(before, self.law.command, &[0, 1, 2]);
    }
}

/// Steps of one of the two tests, shared by the cores.
fn on_each_core(walk: impl Fn(u64, u64) -> Count + Sync) -> Count {
    let asked = std::env::var("TAUTSCOPE_STEPS").is_ok();
    // Half for each of the two tests; without optimization a step takes 20 times as long.
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
fn moved(random: &mut Random, reference: PerDof<f64>) -> PerDof<f64> {
    let mut next = reference;
    for (value, unit) in next.iter_mut().zip(UNITS) {
        let place = walk(random, *value / (10.0 * unit));
        if random.below(3) > 0 {
            *value = place * 10.0 * unit;
        }
    }
    next
}

/// By itself, with any estimate, share and shift; the law continues from what a limit leaves of a step.
#[test]
fn bounds_of_the_vector_law() {
    on_each_core(vector_walk).report("best");
}

fn vector_walk(seed: u64, wanted: u64) -> Count {
    let (mut random, mut checked) = (Random(seed), CheckedLaw::new());
    checked.step([0.0; 3], 1.0);
    while checked.count.steps < wanted {
        let reference = checked.reference;
        match random.below(400) {
            0 | 1 => checked.measure(&mut random),
            2 => checked.set_share([0.0, 1.0, 0.3][usize::try_from(random.below(3)).unwrap()]),
            3 => checked.shift_reference(UNITS.map(|unit| unit * random.within(-1.0, 1.0))),
            4 => checked.step([0.0, f64::NAN, 0.0], 1.0),
            _ => {
                let next = moved(&mut random, reference);
                let part = if random.below(10) == 0 {
                    random.within(0.0, 1.0)
                } else {
                    1.0
                };
                checked.step(next, part);
            }
        }
    }
    checked.count
}

/// Within supervision, through jumps, holds and fades: the bounds of the law, and |c - u| <= `width_limit`, but for the
/// reference's motion of one tick.
#[test]
fn bounds_of_the_supervised_vector_law() {
    on_each_core(supervised_walk).report("best");
}

fn supervised_walk(seed: u64, wanted: u64) -> Count {
    let (mut random, mut checked) = (Random(seed), CheckedLaw::new());
    let shaft = Friction::new([0, 0, 2], [1.0; 3]).unwrap();
    let limiters = CommandLimiters::new(&safety(), [LIMIT; 3], PERIOD, shaft).unwrap();
    let mut monitors = Monitors::new(&safety(), &dofs(), PERIOD, limiters).unwrap();
    let (mut reference, mut time, mut ticks) = ([0.0; 3], 0.0, 0);
    let mut led = [0.0_f64; 3];
    let mut speed = [0.0; 3];
    monitors.step(&mut checked, reference, None, time, |_, command| command);
    while checked.count.steps < wanted && ticks < 4 * wanted {
        time += PERIOD;
        ticks += 1;
        match random.below(2000) {
            0..10 => checked.measure(&mut random),
            10 => monitors.raise(Flag::Frozen),
            11 => monitors.raise(Flag::FollowingError),
            12 => monitors.acknowledge(),
            13..100 => monitors.engage(),
            _ => {}
        }
        for (speed, unit) in speed.iter_mut().zip(UNITS) {
            if random.below(100) == 0 {
                *speed = if random.below(4) == 0 {
                    0.0
                } else {
                    unit * random.within(-0.5, 0.5)
                };
            }
        }
        let mut next = reference;
        for ((next, speed), unit) in next.iter_mut().zip(speed).zip(UNITS) {
            *next = (*next + speed).clamp(-90.0 * unit, 190.0 * unit);
            if random.below(20_000) == 0 {
                *next += 40.0 * unit * random.within(-1.0, 1.0);
            }
        }
        monitors.step(&mut checked, next, None, time, |_, command| command);
        reference = next;
        for (dof, limit) in safety().width_limit.into_iter().enumerate() {
            let lead = (checked.law.command[dof] - checked.reference[dof]).abs();
            // Motion that is discarded counts from where it was.
            let discarded = UNITS[dof] * 1.001;
            checked.count.gain += u64::from(lead > led[dof].max(limit) + discarded);
            led[dof] = lead;
        }
    }
    checked.count
}
