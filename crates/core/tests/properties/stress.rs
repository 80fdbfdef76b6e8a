//! The whole loop, monitors included, under anything that may come.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::r#loop::any_loop::{BandLoop as _, Loop as _};
use crate::r#loop::profile::BandProfile;
use crate::r#loop::report::Status;
use crate::supervision::flags::Flag;
use crate::supervision::reactions::Reaction;

use super::support::loops::{Loop, article, best, model};
use super::support::{self, PERIOD, UNITS};

/// Xorshift.
struct Chance(u64);

impl Chance {
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// From -1 to 1.
    fn share(&mut self) -> f64 {
        #[allow(clippy::cast_precision_loss)]
        let whole = (self.bits() >> 11) as f64;
        whole / f64::from(2_u32).powi(52) - 1.0
    }

    fn once_in(&mut self, count: u64) -> bool {
        self.bits().is_multiple_of(count)
    }
}

/// How many control ticks; `TAUTSCOPE_STEPS=1000000000 cargo test --release` is the long run.
fn steps(default: u64) -> u64 {
    std::env::var("TAUTSCOPE_STEPS").map_or(default, |text| text.parse().unwrap())
}

/// The common bound of insertion and rotation, in the limits of their width; nothing moves while both rest.
fn check_coupled(moved: PerDof<f64>, pulled: PerDof<f64>, gain: f64, place: &str) {
    let [first, second, _] = support::safety().width_limit;
    let norm = |x: PerDof<f64>| (x[0] / first).hypot(x[1] / second);
    let (dc, du) = (norm(moved), norm(pulled));
    assert!(du > 0.0 || dc == 0.0, "{place}: {dc} for {du}");
    // The travel, which the offset of the reference gate may have, is ten times the limit of the width.
    let rounding = 32.0 * gain * f64::EPSILON;
    assert!(
        du.is_nan() || dc <= gain * du * (1.0 + 1e-9) + rounding,
        "{place}: {dc} for {du}"
    );
}

/// The most that a command may move, in motions of the reference.
fn gain_limit<P: BandProfile>() -> f64 {
    let settings = support::settings(&support::safety());
    if P::IS_COUPLED {
        settings.law.free_gain
    } else {
        settings.insertion.gain_limit
    }
}

/// Motion, rest, tremor and jumps of the reference, late ticks, images of every kind, and an operator who re-engages: every
/// command keeps the law.
fn stress<P: BandProfile>(mut reduction: Loop<P>, seed: u64, steps: u64) {
    let mut chance = Chance(seed);
    let truth = model();
    let gain = gain_limit::<P>();
    let (mut reference, mut speed, mut time) = ([0.025, 0.0, 0.9], [0.0; 3], 0.0);
    let mut command = reduction.step(reference, None, time);
    let (mut updates, mut worst) = (0_u64, Reaction::None);
    for tick in 0..steps {
        let mut next = reference;
        for ((next, speed), unit) in next.iter_mut().zip(&mut speed).zip(UNITS) {
            if chance.once_in(200) {
                *speed = if chance.once_in(4) {
                    0.0
                } else {
                    0.3 * unit * chance.share()
                };
            }
            *next += *speed;
            // Never out of the world.
            *next = next.clamp(-90.0 * unit, 190.0 * unit);
        }
        if tick == 10_000 {
            // However few steps there are, this comes.
            reduction.raise(Flag::FollowingError);
        }
        match chance.bits() % 20_000 {
            0 => next[0] += 0.01 * chance.share(),
            1 => next[1] = f64::NAN,
            2 => time += 0.5 * chance.share().abs(),
            3 => time -= 0.3,
            4 => reduction.raise(Flag::FollowingError),
            _ => {}
        }
        if chance.once_in(1000) {
            reduction.engage();
        }
        if chance.once_in(5000) {
            reduction.acknowledge();
        }
        time += PERIOD;
        let stamp = (!chance.once_in(20_000))
            .then_some(time - 0.06 * f64::from(u8::from(chance.once_in(20_000))));
        let now = reduction.step(next, stamp, time);
        let limits = support::safety();
        let moved = [0, 1, 2].map(|dof| now[dof] - command[dof]);
        let pulled = [0, 1, 2].map(|dof| next[dof] - reference[dof]);
        if P::IS_COUPLED {
            check_coupled(moved, pulled, gain, &format!("seed {seed}, tick {tick}"));
        }
        for dof in 0..3 {
            let (dc, du) = (moved[dof], pulled[dof]);
            // The offset of the reference gate, which is not observed here, is as large as the travel.
            let (least, largest) = limits.command_travel[dof];
            let rounding = 4.0 * gain * f64::EPSILON * (largest - least);
            let facts = format!("seed {seed}, tick {tick}, DOF {dof}: {dc} for {du}");
            assert!(now[dof].is_finite(), "{facts}");
            assert!((least..=largest).contains(&now[dof]), "{facts}");
            assert!(
                dc.abs() <= limits.command_speed[dof] * PERIOD + rounding,
                "{facts}"
            );
            if P::IS_COUPLED && dof < 2 {
                continue;
            }
            if du.is_nan() || du == 0.0 {
                assert_eq!(dc, 0.0, "{facts}");
                continue;
            }
            assert!(dc * du >= 0.0 || dc.abs() <= rounding, "{facts}");
            assert!(dc.abs() <= gain * du.abs() + rounding, "{facts}");
        }
        command = now;
        for (reference, next) in reference.iter_mut().zip(next) {
            *reference = if next.is_nan() { *reference } else { next };
        }
        if tick % 8 == 0 && !chance.once_in(50) {
            let mut state = reduction.predicted_state();
            for (value, unit) in state.iter_mut().zip(UNITS) {
                *value += unit * chance.share();
            }
            let measured = truth.predict(state).map(|seen| {
                let [ua, va, ub, vb] = seen.features;
                match chance.bits() % 400 {
                    0..20 => [ub, vb, ua, va],
                    20..30 => [f64::NAN, f64::NAN, ub, vb],
                    30..40 => [ua + 100.0 * chance.share(), va, ub, vb],
                    40 => [f64::INFINITY, va, ub, vb],
                    _ => [ua, va, ub, vb],
                }
            });
            let report =
                reduction.on_features(measured, None, time - 0.05 * chance.share().abs(), None);
            updates += u64::from(report.status == Status::Ok);
            worst = worst.max(report.supervision.reaction);
            for (play, unit) in report.play.iter().zip(UNITS) {
                assert!(
                    (0.0..=30.0 * unit * (1.0 + 1e-12)).contains(&play.width()),
                    "{play:?}"
                );
            }
        }
    }
    assert!(updates > 100, "images were used: {updates}");
    assert_eq!(worst, Reaction::QuickStop, "every kind of trouble came");
}

#[test]
fn every_command_keeps_the_law_in_profile_paper() {
    stress(
        article(|_| Play::new(0.0, 0.0).unwrap()),
        2013,
        steps(500_000),
    );
}

#[test]
fn every_command_keeps_the_law_in_profile_best() {
    stress(best(), 652, steps(20_000));
}

/// c - u - (1 - 1 / `K_b`) p is what it was, however many reversals came.
#[test]
fn the_command_does_not_drift() {
    let mut reduction = article(|unit| Play::new(-12.0 * unit, 12.0 * unit).unwrap());
    let start = [0.025, 0.0, 0.9];
    reduction.step(start, None, 0.0);
    let mut worst = 0.0_f64;
    let mut tick = 0.0;
    for count in 1..=steps(500_000) {
        tick += PERIOD;
        let mut reference = start;
        let way = 15.0 * (3.1 * tick).sin();
        for (value, unit) in reference.iter_mut().zip(UNITS) {
            *value += unit * way;
        }
        let command = reduction.step(reference, None, tick);
        if count % 97 == 0 {
            let tip = reduction.predicted_state();
            worst = worst.max((command[0] - reference[0] - 0.8 * (command[0] - tip[0])).abs());
        }
    }
    assert_eq!(reduction.supervision().reaction, Reaction::None);
    assert!(worst <= 1e-12, "{worst} m");
}
