//! What the control law guarantees, over as many random steps as `TAUTSCOPE_STEPS` says; a million without it.
//!
//! `benchmarks/guarantees` runs these over 1e9 and reads what they print.

use crate::adaptive::axis::AdaptiveAxis;
use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::play::{Play, PlayState};

use super::adaptive::settings;

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

/// A fiftieth of the steps where nobody asks for more, as it learns; each core its share of them.
#[test]
fn gain_of_the_adaptive_law() {
    let asked = std::env::var("TAUTSCOPE_STEPS").is_ok();
    let wanted = if asked { steps() } else { steps() / 50 };
    let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get() as u64);
    let mut count = Count::default();
    std::thread::scope(|scope| {
        let parts: Vec<_> = (0..cores)
            .map(|core| scope.spawn(move || adaptive_walk(2026 + core, wanted.div_ceil(cores))))
            .collect();
        for part in parts {
            count = count.with(&part.join().unwrap());
        }
    });
    count.report("best");
}

fn adaptive_walk(seed: u64, wanted: u64) -> Count {
    let (mut chance, mut count) = (Chance(seed), Count::default());
    let mut axis = AdaptiveAxis::new(settings(0.0, 0.005), chance.play()).unwrap();
    let mut reference = 0.3;
    axis.step(reference);
    while count.steps < wanted {
        let before = axis.command();
        match chance.below(40) {
            0 => {
                let measured = before - chance.within(-4.0, 4.0);
                axis.learn(
                    before,
                    measured,
                    chance.within(0.0, 1.0),
                    [before].into_iter(),
                );
            }
            1 => {
                axis.step(f64::INFINITY);
            }
            _ => {
                let next = walk(&mut chance, reference);
                axis.step(next);
                count.step(next - reference, before, axis.command());
                reference = next;
                continue;
            }
        }
        count.event(before, axis.command());
    }
    count
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
