//! Soak test: over hours of simulated use neither memory, open files nor the tip's error grow. `TAUTSCOPE_HOURS` sets the
//! duration; the default is three minutes.
//!
//! Three degrees of freedom with play, a reference that does not repeat, images every 40 ms with 0.2 px of noise.

// A loop is larger than the lint allows, and is moved once.
#![allow(clippy::large_stack_arrays)]

mod support;

use support::PERIOD;
use support::loops::{Loop, article, article_with, best};
use support::plays::{ThreePlays, real, reference};
use tautscope_core::{BandLoop as _, BandProfile, Loop as _, Play, Reaction};

const TICKS_PER_FRAME: u64 = 8;
const TENTHS: u8 = 10;
/// From when to when the error is averaged with which the last tenth is compared [s]: the offsets are estimated, and
/// nothing has had time to drift.
const EARLY: (f64, f64) = (60.0, 180.0);

/// Resident memory in pages and number of open files; none where the system does not provide them.
fn resources() -> Option<(u32, usize)> {
    let memory = std::fs::read_to_string("/proc/self/statm").ok()?;
    let files = std::fs::read_dir("/proc/self/fd").ok()?.count();
    Some((memory.split(' ').nth(1)?.parse().ok()?, files))
}

/// Simulated duration for each law.
fn hours() -> f64 {
    let hours = std::env::var("TAUTSCOPE_HOURS");
    hours.map_or(0.05, |text| text.parse().unwrap())
}

/// Runs a loop; returns a description of what grew or drifted, empty if nothing did.
fn soak<P: BandProfile>(law: &str, mut reduction: Loop<P>) -> String {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive"
    )]
    let ticks = (hours() / f64::from(TENTHS) * 3600.0 / PERIOD) as u64;
    let mut plays = ThreePlays::new();
    let (mut early, mut late) = (0.0, 0.0);
    let (mut before, mut worst) = (None, Reaction::None);
    for tenth in 0..TENTHS {
        let (start, mut error) = (u64::from(tenth) * ticks, 0.0);
        for tick in start..start + ticks {
            let time = real(tick) * PERIOD;
            let reference = reference(time);
            let command = reduction.step(reference, None, time);
            assert!(
                command.iter().all(|value| value.is_finite()),
                "{law} {tick}"
            );
            plays.step(command);
            if tick.is_multiple_of(TICKS_PER_FRAME) {
                reduction.on_features(plays.measure(), None, time, Some(tick));
            }
            worst = worst.max(reduction.supervision().reaction);
            let distance = (plays.tip[0].output - reference[0]).abs();
            error += distance / real(ticks);
            if (EARLY.0..EARLY.1).contains(&time) {
                early += distance * PERIOD / (EARLY.1 - EARLY.0);
            }
        }
        if tenth == 1 {
            before = resources();
        }
        late = error;
        eprintln!(
            "{law}: {:.2} h, error of the tip {:.3} mm",
            hours() * f64::from(tenth + 1) / f64::from(TENTHS),
            1e3 * error
        );
    }
    let grown = match (before, resources()) {
        (Some((memory, files)), Some((more, now))) => files != now || 100 * more > 101 * memory,
        _ => false,
    };
    let drifted = late > 1.2 * early;
    let stopped = worst >= Reaction::HoldMotion;
    let broken = u64::from(grown) + u64::from(drifted) + u64::from(stopped);
    println!(
        "G15 {law} {} {broken} {}",
        ticks * u64::from(TENTHS),
        late / early
    );
    if broken == 0 {
        return String::new();
    }
    format!(
        "{law}: memory or files grew: {grown}, error of the tip {early} m, later {late} m, {worst:?}. "
    )
}

/// The runs are sequential: files and memory are those of the process.
///
/// The article's law also runs without recovery of its anchor: `broken` counts its drift, but the test does not require
/// that it is none (docs/safety.md).
#[test]
fn nothing_grows_and_nothing_drifts() {
    let none = |_| Play::new(0.0, 0.0).unwrap();
    let grown =
        soak("best", best()) + &soak("recovering", article_with(&support::safety(), 0.1, none));
    soak("paper", article(none));
    assert!(grown.is_empty(), "{grown}");
}
