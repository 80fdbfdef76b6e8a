//! The bounds of hand and tip, which numbers of few bits meet exactly: what is on one is within.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::motion_monitor::{MotionMonitor, MotionMonitorSettings};
use crate::supervision::turning_points::TurningPoints;

/// A little more of a length, and a little less.
const MORE: f64 = 1.0 + 1e-12;
const LESS: f64 = 1.0 - 1e-12;

const SETTINGS: MotionMonitorSettings = MotionMonitorSettings {
    period: 1.0 / 256.0,
    tremor_swing: [0.5; 3],
    slack: [4.0; 3],
    tremor_rate: 1.0,
    turn: [0.5; 3],
    ahead: [1.0; 3],
    cycle_swings: 1,
    cycle_time: 2.0,
};

fn rotation(value: f64) -> PerDof<f64> {
    [0.0, value, 0.0]
}

/// What is raised at the last of these images, each of a time, a reference, a tip, and the contact offsets.
fn last_of(images: &[(f64, f64, f64, (f64, f64))]) -> Flags {
    let mut watch = MotionMonitor::new(SETTINGS).unwrap();
    let mut raised = Flags::NONE;
    for (time, reference, tip, (minus, plus)) in images {
        assert!(raised.is_empty(), "before the last");
        let play = Play::new(*minus, *plus).unwrap();
        raised = watch.look(*time, rotation(*reference), rotation(*tip), [play; 3]);
    }
    raised
}

/// rate > `tremor_rate`, of reversals shorter than the slack.
#[test]
fn a_tremor_is_more_than_so_many_reversals_each_within_the_slack() {
    for (swing, rate, trembles) in [
        (2.0, 1.0, false),
        (2.0, LESS, true),
        (4.0, LESS, false),
        (4.0 * LESS, LESS, true),
    ] {
        let settings = MotionMonitorSettings {
            tremor_rate: rate,
            ..SETTINGS
        };
        let mut watch = MotionMonitor::new(settings).unwrap();
        let mut raised = Flags::NONE;
        for hand in [0.0, swing, 0.0] {
            assert!(raised.is_empty(), "before the first reversal");
            raised = watch.tick(rotation(hand));
        }
        let expected = Flags::when(trembles, Flag::Tremor);
        assert_eq!(raised, expected, "{swing}, {rate}");
    }
}

#[test]
fn a_tip_outruns_beyond_each_bound_and_not_on_it() {
    let slack = (-5.0, 5.0);
    // By share, by way and by place: of a travel of the reference, how far the tip went that had been so far ahead.
    for (travel, gone, lag) in [(4.0, 6.0, 0.0), (1.0, 2.0, 1.0), (1.0, 4.0, -2.0)] {
        for sign in [1.0, -1.0] {
            let said = |gone: f64| {
                let tip = sign * (-8.0 + lag);
                last_of(&[
                    (0.0, 0.0, sign * lag, slack),
                    (0.5, sign * -8.0, tip, slack),
                    (1.0, sign * (travel - 8.0), tip + sign * gone, slack),
                ])
            };
            assert_eq!(said(gone), Flags::NONE, "{travel}, {lag}");
            let over = Flags::of(Flag::Overcompensation);
            assert_eq!(said(gone * MORE), over, "{travel}, {lag}");
        }
    }
}

#[test]
fn slack_is_unlearnt_beyond_twice_what_the_tip_may_be_ahead() {
    for sign in [1.0, -1.0] {
        let said = |less: f64| {
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
        assert_eq!(said(2.0), Flags::NONE);
        assert_eq!(said(2.0 * MORE), Flags::of(Flag::Overcompensation));
    }
}

/// 1.1 times the one before or more, in `cycle_time` or less.
#[test]
fn a_swing_grows_from_its_bound_on_and_in_no_more_than_its_time() {
    let said = |grown: f64, seconds: f64| {
        let ways = [(0.0, 0.0), (1.0, 12.0), (2.0, 2.0), (3.0, 12.0)];
        let mut images = ways.map(|(time, at)| (time, at, at, (-5.0, 5.0))).to_vec();
        for (time, at) in [(4.0, 12.0 - grown), (4.0 + seconds, 40.0)] {
            images.push((time, at, at, (-5.0, 5.0)));
        }
        last_of(&images)
    };
    let cycle = Flags::of(Flag::LimitCycle);
    assert_eq!(said(11.0, 2.0), cycle);
    assert_eq!(said(11.0 * LESS, 2.0), Flags::NONE);
    assert_eq!(said(11.0, 2.0 * MORE), Flags::NONE);
}

#[test]
fn a_signal_turns_beyond_the_band_and_not_on_it() {
    for sign in [1.0, -1.0] {
        let begun = || {
            let mut swings = TurningPoints::new(0.5);
            for value in [0.0, sign * 4.0] {
                assert_eq!(swings.follow(value), None);
            }
            swings
        };
        assert_eq!(begun().follow(sign * 3.5), None);
        assert_eq!(begun().follow(sign * 3.5 * LESS), Some(4.0));
    }
}
