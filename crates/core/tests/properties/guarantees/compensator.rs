//! The article's compensator: gain, rest, no ratchet, and the overshoot of an estimated width that is too large.

use crate::article::compensator::{Compensator, CompensatorState};
use crate::article::play::{Play, PlayState};

use super::{Count, LIMIT, Random, steps, walk};

#[test]
fn gain_of_the_compensator() {
    let (mut random, mut count) = (Random(2013), Count::default());
    let mut law = Compensator::new(LIMIT, LIMIT).unwrap();
    let mut state = CompensatorState::new(random.play());
    let mut reference = 0.3;
    law.step(&mut state, reference);
    while count.steps < steps() {
        let before = state.command();
        match random.below(24) {
            0 => law.retune(&mut state, random.play()),
            1 => {
                let gain = random.within(1.0, LIMIT);
                law = Compensator::new(gain, LIMIT).unwrap();
                law = law.with_recovery(random.within(0.0, 0.9)).unwrap();
                let play = state.play();
                law.retune(&mut state, play);
            }
            2 => {
                law.step(&mut state, f64::NAN);
            }
            _ => {
                let next = walk(&mut random, reference);
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
            let estimated = 10.0 * (1.0 + f64::from(ratio) / 20.0);
            let law = Compensator::new(gain, gain).unwrap();
            let mut state = CompensatorState::new(Play::new(-estimated, 0.0).unwrap());
            let mut tip = PlayState { output: 0.0 };
            let mut go = |reference: f64| truth.step(&mut tip, law.step(&mut state, reference));
            go(0.0);
            let turned_at = go(15.0);
            let mut overshoot = 0.0_f64;
            for tick in 1..=8000 {
                let back = f64::from(tick) * 0.005;
                overshoot = overshoot.max(turned_at - go(15.0 - back) - back);
            }
            let expected = (estimated * (1.0 - 1.0 / gain) - 10.0).max(0.0);
            worst = worst.max((overshoot - expected).abs());
            cases += 1;
        }
    }
    println!("G4 paper {cases} {} {worst}", u64::from(worst > 0.01));
    assert!(worst <= 0.01, "{worst} mm");
}
