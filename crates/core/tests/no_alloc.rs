//! The control tick and the image update do not allocate: an allocation aborts the test.

// An allocator that aborts leaves the stack only.
#![allow(clippy::large_stack_arrays)]

mod support;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use support::loops::{Loop, article_with, best_with, model};
use tautscope_core::{
    BandLoop as _, BandProfile, Flag, Loop as _, Play, Reaction, Status, Triggers,
};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// Over at least `TAUTSCOPE_TICKS` ticks, each loop at least once through every flag.
#[test]
fn step_and_image_update_do_not_allocate() {
    let wanted = std::env::var("TAUTSCOPE_TICKS");
    let wanted: u64 = wanted.map_or(0, |text| text.parse().unwrap());
    let mut ticks = 0;
    loop {
        ticks += run_article() + run_best() + run_best_without_outliers();
        if ticks >= wanted {
            break;
        }
    }
    println!("G12 both {ticks} 0 0");
}

// Separate functions, so that the stack holds one loop at a time.
fn run_article() -> u64 {
    run(article_with(&support::safety(), 0.0, |_| {
        Play::new(0.0, 0.0).unwrap()
    }))
}

fn run_best() -> u64 {
    run(best_with(&support::safety(), 4.0))
}

fn run_best_without_outliers() -> u64 {
    run(best_with(&support::safety(), f64::INFINITY))
}

/// Runs a loop; returns the number of ticks.
fn run<P: BandProfile>(mut reduction: Loop<P>) -> u64 {
    let mut ticks = 1;
    let (mut used, mut updated, mut worst) = (0, 0, Reaction::None);
    let truth = model();
    let posture = |time: f64| {
        let wave = time.sin();
        [0.025 + 0.01 * wave, wave, 0.9 + 0.5 * wave]
    };
    assert_no_alloc(|| {
        for tick in 0..4000_u32 {
            let time = f64::from(tick) * 0.005;
            reduction.step(posture(time), None, time);
            ticks += 1;
            if tick % 8 == 0 {
                let captured_at = time - 0.08;
                let seen = truth.predict(posture(captured_at - 0.3));
                let wrong = if tick % 80 == 0 { 300.0 } else { 0.0 };
                let measured = seen.map(|seen| {
                    let [ua, va, ub, vb] = seen.features;
                    [ua, va, ub + wrong, vb]
                });
                let report = reduction.on_features(measured, None, captured_at, None);
                used += u32::from(report.status == Status::Ok);
                updated += u32::from(report.triggers.iter().any(Triggers::any));
            }
        }
        reduction.step([f64::NAN; 3], None, 20.0);
        reduction.on_features(None, None, 20.0, None);
        // Every flag, long enough for every step of its escalation.
        for (flag, minute) in Flag::ALL.iter().zip(1_u32..) {
            reduction.engage();
            for tick in 0..2000_u32 {
                let time = 60.0 * f64::from(minute) + f64::from(tick) * 0.005;
                reduction.raise(*flag);
                reduction.step(posture(time), Some(time), time);
                ticks += 1;
                if tick % 8 == 0 {
                    let seen = truth.predict(posture(time)).map(|seen| seen.features);
                    reduction.on_features(seen, None, time, Some(u64::from(tick)));
                }
                worst = worst.max(reduction.supervision().reaction);
            }
            reduction.acknowledge();
        }
    });
    assert_eq!(worst, Reaction::Disable);
    assert!(
        used > 200 && updated > 40,
        "all parts of the update ran: {used} {updated}"
    );
    ticks
}
