//! What the control law guarantees, over `TAUTSCOPE_STEPS` random steps; a million without it.
//!
//! `benchmarks/guarantees` runs these over 1e9 and reads what they print.

mod compensator;
mod vector_law;

use crate::article::play::Play;

const LIMIT: f64 = 5.0;

fn steps() -> u64 {
    let wanted = std::env::var("TAUTSCOPE_STEPS");
    wanted.map_or(1_000_000, |text| text.parse().unwrap())
}

/// Marsaglia's xorshift64*: quick, and the same everywhere.
pub(super) struct Random(pub(super) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    pub(super) fn below(&mut self, count: u64) -> u64 {
        (self.next() >> 32) % count
    }

    #[expect(clippy::cast_precision_loss, reason = "53 bits")]
    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
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

/// Number of violations, and the largest excess over the gain, in units in the last place.
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

fn walk(random: &mut Random, reference: f64) -> f64 {
    let next = reference + random.travel();
    if next.abs() > 5.0 { reference } else { next }
}
