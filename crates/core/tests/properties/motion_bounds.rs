//! The bounds of the motion monitor, met exactly by numbers of few bits: a value on a bound is within.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::settings::DofSettings;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::motion_monitor::MotionMonitor;
use crate::supervision::settings::SafetySettings;
use crate::supervision::turning_points::TurningPoints;

use super::support::{dofs, safety};

/// Factors just above and just below 1.
const MORE: f64 = 1.0 + 1e-12;
const LESS: f64 = 1.0 - 1e-12;

fn new_monitor(tremor_rate: f64) -> MotionMonitor<3> {
    let settings = SafetySettings {
        width_limit: [4.0; 3],
        tremor_swing: 1.0,
        tremor_rate,
        ahead_limit: 0.25,
        cycle_swings: 1,
        ..safety()
    };
    let dofs = dofs().map(|dof| DofSettings {
        update_distance: 0.5,
        ..dof
    });
    MotionMonitor::new(&settings, &dofs, 1.0 / 256.0).unwrap()
}

fn rotation(value: f64) -> PerDof<f64> {
    [0.0, value, 0.0]
}

/// The flags of the last of these images, each with a time, a reference, a tip, and the contact offsets.
fn last_of(images: &[(f64, f64, f64, (f64, f64))]) -> Flags {
    let mut monitor = new_monitor(1.0);
    let mut raised = Flags::NONE;
    for (time, reference, tip, (minus, plus)) in images {
        assert!(raised.is_empty(), "before the last");
        let play = Play::new(*minus, *plus).unwrap();
        raised = monitor.update_measurement(*time, rotation(*reference), rotation(*tip), [play; 3]);
    }
    raised
}

/// rate > `tremor_rate`, of reversals shorter than the slack.
#[test]
fn a_tremor_has_more_reversals_than_its_rate_each_within_the_slack() {
    for (swing, rate, trembles) in [
        (2.0, 1.0, false),
        (2.0, LESS, true),
        (4.0, LESS, false),
        (4.0 * LESS, LESS, true),
    ] {
        let mut monitor = new_monitor(rate);
        let mut raised = Flags::NONE;
        for input in [0.0, swing, 0.0] {
            assert!(raised.is_empty(), "before the first reversal");
            raised = monitor.update_reference(rotation(input));
        }
        let expected = Flags::when(trembles, Flag::Tremor);
        assert_eq!(raised, expected, "{swing}, {rate}");
    }
}

#[test]
fn a_tip_overtakes_beyond_each_bound_and_not_on_it() {
    let slack = (-5.0, 5.0);
    // Bounds of ratio, travel and position: (travel of the reference, travel of the tip, how far the tip had lagged).
    for (travel, gone, lag) in [(4.0, 6.0, 0.0), (1.0, 2.0, 1.0), (1.0, 4.0, -2.0)] {
        for sign in [1.0, -1.0] {
            let raised = |gone: f64| {
                let tip = sign * (-8.0 + lag);
                last_of(&[
                    (0.0, 0.0, sign * lag, slack),
                    (0.5, sign * -8.0, tip, slack),
                    (1.0, sign * (travel - 8.0), tip + sign * gone, slack),
                ])
            };
            assert_eq!(raised(gone), Flags::NONE, "{travel}, {lag}");
            let over = Flags::of(Flag::Overcompensation);
            assert_eq!(raised(gone * MORE), over, "{travel}, {lag}");
        }
    }
}

#[test]
fn an_offset_decreases_by_more_than_twice_the_limit_of_the_lead() {
    for sign in [1.0, -1.0] {
        let raised = |less: f64| {
            let after = if sign > 0.0 {
                (-8.0, 8.0 - less)
            } else {
                (less - 8.0, 8.0)
            };
            let way = [0.0, -8.0, -7.0, -6.0].map(|at| sign * at);
            last_of(&[
                (0.0, way[0], way[0], (-8.0, 8.0)),
                (0.5, way[1], way[1], (-8.0, 8.0)),
                (1.0, way[2], way[2], (-8.0, 8.0)),
                (1.5, way[3], way[3], after),
            ])
        };
        assert_eq!(raised(2.0), Flags::NONE);
        assert_eq!(raised(2.0 * MORE), Flags::of(Flag::Overcompensation));
    }
}

/// 1.1 times the one before or more, in `cycle_time` or less.
#[test]
fn a_swing_grows_from_its_bound_on_and_within_its_time() {
    let raised = |grown: f64, seconds: f64| {
        let ways = [(0.0, 0.0), (1.0, 12.0), (2.0, 2.0), (3.0, 12.0)];
        let mut images = ways.map(|(time, at)| (time, at, at, (-5.0, 5.0))).to_vec();
        for (time, at) in [(4.0, 12.0 - grown), (4.0 + seconds, 40.0)] {
            images.push((time, at, at, (-5.0, 5.0)));
        }
        last_of(&images)
    };
    let cycle = Flags::of(Flag::LimitCycle);
    assert_eq!(raised(11.0, 2.0), cycle);
    assert_eq!(raised(11.0 * LESS, 2.0), Flags::NONE);
    assert_eq!(raised(11.0, 2.0 * MORE), Flags::NONE);
}

#[test]
fn a_signal_turns_beyond_the_band_and_not_on_it() {
    for sign in [1.0, -1.0] {
        let begun = || {
            let mut points = TurningPoints::new(0.5);
            for value in [0.0, sign * 4.0] {
                assert_eq!(points.update(value), None);
            }
            points
        };
        assert_eq!(begun().update(sign * 3.5), None);
        assert_eq!(begun().update(sign * 3.5 * LESS), Some(4.0));
    }
}
