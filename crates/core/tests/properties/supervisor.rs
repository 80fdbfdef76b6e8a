//! The table, and what the supervisor makes of any sequence of events.

use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reactions::{Clear, Reaction, Source, TABLE};
use crate::supervision::supervisor::{Event, Supervisor, SupervisorSettings};
use proptest::prelude::*;

use super::{config, support};

fn supervisor() -> Supervisor {
    Supervisor::new(support::supervisor()).unwrap()
}

fn event(source: Source, time: f64, travel: f64, raised: Flags) -> Event {
    Event {
        source,
        time,
        travel,
        raised,
        severe: Flags::NONE,
    }
}

#[derive(Debug, Clone)]
enum Action {
    Update(Source, f64, f64, Flags, Flags),
    Engage,
    Acknowledge,
}

fn flags() -> impl Strategy<Value = Flags> {
    prop::collection::vec(prop::sample::select(Flag::ALL), 0..3).prop_map(|all| {
        all.into_iter()
            .fold(Flags::NONE, |sum, one| sum.and(Flags::of(one)))
    })
}

fn actions() -> impl Strategy<Value = Vec<Action>> {
    let source = prop::sample::select(&[Source::Tick, Source::Frame, Source::Rig]);
    let time = prop_oneof![8 => -0.1..2.0, 1 => Just(f64::NAN), 1 => Just(-100.0)];
    let travel = prop_oneof![8 => 0.0..2.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY)];
    let action = prop_oneof![
        8 => (source, time, travel, flags(), prop_oneof![4 => Just(Flags::NONE), 1 => flags()])
            .prop_map(|(source, time, travel, raised, severe)| {
                Action::Update(source, time, travel, raised, severe)
            }),
        1 => Just(Action::Engage),
        1 => Just(Action::Acknowledge),
    ];
    prop::collection::vec(action, 0..100)
}

fn apply(supervisor: &mut Supervisor, now: &mut f64, action: &Action, more: Flags) {
    match action {
        Action::Update(source, step, travel, raised, severe) => {
            *now += if step.is_finite() { *step } else { 0.0 };
            supervisor.update(&Event {
                source: *source,
                time: if step.is_nan() { f64::NAN } else { *now },
                travel: *travel,
                raised: raised.and(more),
                severe: *severe,
            });
        }
        Action::Engage => supervisor.engage(),
        Action::Acknowledge => supervisor.acknowledge(),
    }
}

#[test]
fn the_table_has_every_flag_in_its_place_and_ladders_go_up() {
    assert_eq!(TABLE.len(), Flag::ALL.len());
    for (rule, flag) in TABLE.iter().zip(Flag::ALL) {
        assert_eq!(rule.flag, *flag);
        assert!(!rule.ladder.is_empty(), "{flag:?}");
        assert!(rule.ladder.is_sorted_by(|a, b| a.0 < b.0), "{flag:?}");
        for (reaction, clear) in rule.ladder {
            let by_itself = *clear == Clear::Auto;
            // Motion that has been stopped never starts by itself; drives that were disabled need a new start.
            assert_eq!(by_itself, *reaction < Reaction::PassThrough, "{flag:?}");
            assert_eq!(
                *clear == Clear::Restart,
                *reaction == Reaction::Disable,
                "{flag:?}"
            );
            assert!(!by_itself || rule.source != Source::Rig, "{flag:?}");
        }
        assert!(!rule.climbs || rule.ladder.len() > 1, "{flag:?}");
    }
}

#[test]
fn every_rung_is_reached_and_cleared_as_the_table_says() {
    for rule in &TABLE {
        for (rung, (reaction, clear)) in rule.ladder.iter().enumerate() {
            let mut supervisor = supervisor();
            let flag = Flags::of(rule.flag);
            let severe = if rung > 0 && !rule.climbs {
                flag
            } else {
                Flags::NONE
            };
            let mut now = 0.0;
            for _ in 0..=rung {
                supervisor.update(&Event {
                    source: rule.source,
                    time: now,
                    travel: 0.0,
                    raised: flag,
                    severe,
                });
                now += 4.0;
            }
            assert_eq!(supervisor.reaction(), *reaction, "{rule:?}");
            assert_eq!(supervisor.latched(), flag);
            assert_eq!(supervisor.flags(), flag);
            let good = |supervisor: &mut Supervisor, count: u32| {
                for _ in 0..count {
                    supervisor.update(&event(rule.source, now, 0.0, Flags::NONE));
                }
            };
            match clear {
                Clear::Auto => {
                    let needed = if rule.source == Source::Frame { 5 } else { 200 };
                    supervisor.engage();
                    good(&mut supervisor, needed - 1);
                    assert_eq!(supervisor.reaction(), *reaction, "{rule:?}");
                    good(&mut supervisor, 1);
                }
                Clear::Engage => {
                    good(&mut supervisor, 1000);
                    assert_eq!(supervisor.reaction(), *reaction, "{rule:?}");
                    supervisor.engage();
                }
                Clear::Restart => {
                    good(&mut supervisor, 1000);
                    supervisor.engage();
                    supervisor.acknowledge();
                    assert_eq!(supervisor.reaction(), *reaction, "{rule:?}");
                    continue;
                }
            }
            assert_eq!(supervisor.reaction(), Reaction::None, "{rule:?}");
            assert_eq!(
                supervisor.latched(),
                flag,
                "a warning stays until it is seen"
            );
            supervisor.acknowledge();
            assert!(supervisor.latched().is_empty());
        }
    }
}

#[test]
fn hold_ends_by_time_or_by_travel_then_motion_fades_and_comes_back_once_seen() {
    let frozen = Flags::of(Flag::Frozen);
    let mut by_travel = supervisor();
    by_travel.update(&event(Source::Frame, 0.0, 0.0, frozen));
    by_travel.update(&event(Source::Tick, 0.1, 3.9, Flags::NONE));
    by_travel.update(&event(Source::Frame, 0.1, 0.0, frozen));
    assert_eq!(by_travel.reaction(), Reaction::HoldEstimate);
    by_travel.update(&event(Source::Tick, 0.2, 0.2, Flags::NONE));
    by_travel.update(&event(Source::Frame, 0.2, 0.0, frozen));
    assert_eq!(by_travel.reaction(), Reaction::Fade);

    let mut supervisor = supervisor();
    supervisor.update(&event(Source::Frame, 0.0, 0.0, frozen));
    supervisor.update(&event(Source::Frame, 4.0, 0.0, frozen));
    assert_eq!(supervisor.reaction(), Reaction::Fade);
    // Not by the clock.
    supervisor.update(&event(Source::Tick, 1000.0, 0.0, Flags::NONE));
    assert!((supervisor.lead() - 1.0).abs() < 1e-12);
    supervisor.update(&event(Source::Tick, 1000.0, 0.5, Flags::NONE));
    assert!((supervisor.lead() - 0.75).abs() < 1e-12);
    for _ in 0..5 {
        supervisor.update(&event(Source::Frame, 1000.0, 0.0, Flags::NONE));
    }
    assert_eq!(supervisor.reaction(), Reaction::None);
    supervisor.update(&event(Source::Tick, 1001.0, 9.0, Flags::NONE));
    assert!(
        (supervisor.lead() - 0.75).abs() < 1e-12,
        "nobody has seen the warning"
    );
    supervisor.acknowledge();
    supervisor.update(&event(Source::Tick, 1001.0, 0.3, Flags::NONE));
    assert!((supervisor.lead() - 0.9).abs() < 1e-12);
    supervisor.update(&event(Source::Tick, 1001.0, 9.0, Flags::NONE));
    assert!((supervisor.lead() - 1.0).abs() < 1e-12);
}

/// The longest time and travel there may be: with either the hold is over.
#[test]
fn a_hold_ends_on_its_bound() {
    let frozen = Flags::of(Flag::Frozen);
    let settings = support::supervisor();
    for (time, travel, expected) in [
        (settings.hold_time, 0.0, Reaction::Fade),
        (0.0, settings.hold_travel, Reaction::Fade),
        (0.999 * settings.hold_time, 0.0, Reaction::HoldEstimate),
        (0.0, 0.999 * settings.hold_travel, Reaction::HoldEstimate),
    ] {
        let mut supervisor = supervisor();
        supervisor.update(&event(Source::Frame, 0.0, 0.0, frozen));
        supervisor.update(&event(Source::Frame, time, travel, frozen));
        assert_eq!(supervisor.reaction(), expected, "{time} s, {travel}");
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let good = support::supervisor();
    let cases: [(&str, SupervisorSettings); 6] = [
        (
            "hold_time",
            SupervisorSettings {
                hold_time: -1.0,
                ..good
            },
        ),
        (
            "hold_travel",
            SupervisorSettings {
                hold_travel: f64::NAN,
                ..good
            },
        ),
        (
            "fade_travel",
            SupervisorSettings {
                fade_travel: 0.0,
                ..good
            },
        ),
        (
            "restore_travel",
            SupervisorSettings {
                restore_travel: 0.0,
                ..good
            },
        ),
        (
            "good_frames",
            SupervisorSettings {
                good_frames: 0,
                ..good
            },
        ),
        (
            "good_ticks",
            SupervisorSettings {
                good_ticks: 0,
                ..good
            },
        ),
    ];
    for (field, settings) in cases {
        assert_eq!(Supervisor::new(settings).unwrap_err().field, field);
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn any_events_keep_the_lead_a_share_and_change_it_by_motion_alone(actions in actions()) {
        let (mut supervisor, mut now) = (supervisor(), 0.0);
        for action in actions {
            let before = supervisor.lead();
            apply(&mut supervisor, &mut now, &action, Flags::NONE);
            let lead = supervisor.lead();
            prop_assert!((0.0..=1.0).contains(&lead));
            let passes = supervisor.reaction() == Reaction::PassThrough;
            let still = !matches!(action, Action::Update(_, _, travel, _, _) if travel > 0.0);
            prop_assert!(passes || !still || (lead - before).abs() == 0.0);
            prop_assert!(!supervisor.flags().is_empty() || supervisor.reaction() == Reaction::None);
        }
    }

    /// The same history with one more flag raised all the time never has the milder reaction.
    #[test]
    fn more_flags_are_never_answered_more_mildly(
        actions in actions(), extra in prop::sample::select(Flag::ALL)
    ) {
        let (mut with, mut without) = (supervisor(), supervisor());
        let (mut now, mut again) = (0.0, 0.0);
        for action in actions {
            apply(&mut with, &mut now, &action, Flags::of(extra));
            apply(&mut without, &mut again, &action, Flags::NONE);
            // What stops motion is cleared by re-engaging, a milder flag is not.
            if matches!(action, Action::Update(..)) {
                prop_assert!(with.reaction() >= without.reaction());
            }
        }
    }
}
