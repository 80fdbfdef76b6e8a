//! Motion that is discarded at a limit: reference and tip differ by no more than the reference went beyond it.

use crate::article::play::Play;
use crate::r#loop::any_loop::Loop as _;
use crate::r#loop::paper::Paper;
use crate::supervision::flags::Flag;

use super::support::loops::{Loop, article_with};
use super::support::{PERIOD, UNITS, open_loop};

/// A loop with the true slack, and the tip; in [`UNITS`] of the insertion.
struct Run {
    reduction: Loop<Paper>,
    input: f64,
    time: f64,
    /// Largest command that the actuators can follow.
    end: f64,
}

impl Run {
    fn begun(recovery: f64, minus: f64, plus: f64) -> Self {
        let mut run = Self {
            reduction: article_with(&open_loop(), recovery, |unit| {
                Play::new(minus * unit, plus * unit).unwrap()
            }),
            input: 0.0,
            time: 0.0,
            end: f64::INFINITY,
        };
        run.go(0.0);
        run
    }

    /// Move the reference slowly to a place; command and tip there.
    fn go(&mut self, place: f64) -> (f64, f64) {
        let from = self.input;
        let mut command = 0.0;
        for tick in 1..=500 {
            self.input = from + (place - from) * f64::from(tick) / 500.0;
            self.time += PERIOD;
            let reference = [self.input * UNITS[0], 0.0, 0.0];
            let end = self.end * UNITS[0];
            let within = |_, [first, second, third]: [f64; 3]| [end.min(first), second, third];
            [command, ..] = self
                .reduction
                .step_within(reference, None, self.time, within);
        }
        let [tip, ..] = self.reduction.predicted_state();
        (command / UNITS[0], tip / UNITS[0])
    }

    fn is_limited(&self) -> bool {
        self.has(Flag::Monitor)
    }

    fn has(&self, flag: Flag) -> bool {
        self.reduction.supervision().latched.contains(flag)
    }
}

/// The law continues from what the actuators followed, as at the end of the travel.
#[test]
fn the_limit_of_an_actuator_is_an_end_of_the_travel() {
    let mut run = Run::begun(0.0, -10.0, 15.0);
    run.go(150.0);
    let (_, before) = run.go(100.0);
    assert!(!run.is_limited());
    run.end = 180.0;
    let (end, tip) = run.go(230.0);
    assert!(run.is_limited());
    assert!(
        (end - 180.0).abs() < 1e-9 && (end - tip - 15.0).abs() < 1e-9,
        "{end}, {tip}"
    );
    let (_, after) = run.go(100.0);
    // The command is at the end when the reference is at 168.
    assert!((before - after - 62.0).abs() < 1e-6, "{}", before - after);
}

/// Nothing catches up later, also by a law that returns its command to the reference.
#[test]
fn strokes_against_the_end_of_the_travel_lose_what_is_beyond_it_and_no_more() {
    for recovery in [0.0, 0.3] {
        let mut run = Run::begun(recovery, -10.0, 15.0);
        run.go(150.0);
        let (_, before) = run.go(100.0);
        assert!(!run.is_limited());
        // The travel ends at 200.
        let (end, _) = run.go(230.0);
        assert!(run.is_limited() && end <= 200.0, "{end}");
        for _ in 0..20 {
            run.go(150.0);
            let (_, after) = run.go(100.0);
            // Moving up, the command leads by 0.8 * 15, so it is at the end when the reference is at 188.
            let lost = before - after;
            assert!((lost - 42.0).abs() < 1e-6, "{recovery}: {lost}");
        }
    }
}

#[test]
fn a_slack_too_wide_for_the_lead_costs_compensation_and_the_tip_stays_with_the_reference() {
    // Moving up, the law would lead by 0.8 * 40; the limit is 30.
    let mut run = Run::begun(0.0, -10.0, 40.0);
    run.go(150.0);
    assert!(run.has(Flag::WidthLimit) && !run.is_limited());
    let (_, first) = run.go(50.0);
    for _ in 0..50 {
        run.go(150.0);
        run.go(50.0);
    }
    let (_, last) = run.go(50.0);
    assert!((last - first).abs() < 1e-6, "{first}, later {last}");
    let lacks = 0.2 * 50.0 + 2.0;
    assert!((last - 50.0).abs() <= lacks, "{last}");
}
