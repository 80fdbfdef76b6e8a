//! The supervisor: the table of reactions, and any sequence of events.

use crate::supervision::flags::{Flag, Flags};
use crate::supervision::reactions::{Clear, Reaction, Source, TABLE};
use crate::supervision::settings::SafetySettings;
use crate::supervision::supervisor::{Event, Supervisor};
use proptest::prelude::*;

use super::config;
use super::support::safety;

fn supervisor() -> Supervisor<3> {
    Supervisor::new(&safety()).unwrap()
}

fn event(source: Source, time: f64, travel: f64, raised: Flags) -> Event {
    Event {
        source,
        time,
        travel,
        raised,
        severe: Flags::NONE,
        open: Flags::NONE,
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
            .fold(Flags::NONE, |sum, one| sum.union(Flags::of(one)))
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

fn apply(supervisor: &mut Supervisor<3>, now: &mut f64, action: &Action, more: Flags) {
    match action {
        Action::Update(source, step, travel, raised, severe) => {
            *now += if step.is_finite() { *step } else { 0.0 };
            supervisor.update(&Event {
                source: *source,
                time: if step.is_nan() { f64::NAN } else { *now },
                travel: *travel,
                raised: raised.union(more),
                severe: *severe,
                open: Flags::NONE,
            });
        }
        Action::Engage => supervisor.engage(),
        Action::Acknowledge => supervisor.acknowledge(),
    }
}

#[test]
fn the_table_has_every_flag_in_its_place_and_levels_increase() {
    assert_eq!(TABLE.len(), Flag::ALL.len());
    for (rule, flag) in TABLE.iter().zip(Flag::ALL) {
        assert_eq!(rule.flag, *flag);
        assert!(!rule.levels.is_empty(), "{flag:?}");
        assert!(rule.levels.is_sorted_by(|a, b| a.0 < b.0), "{flag:?}");
        for (reaction, clear) in rule.levels {
            let is_automatic = *clear == Clear::Auto;
            // Motion that was stopped never restarts by itself; drives that were disabled need a new start.
            assert_eq!(is_automatic, *reaction < Reaction::PassThrough, "{flag:?}");
            assert_eq!(
                *clear == Clear::Restart,
                *reaction == Reaction::Disable,
                "{flag:?}"
            );
            assert!(!is_automatic || rule.source != Source::Rig, "{flag:?}");
        }
        assert!(!rule.escalates || rule.levels.len() > 1, "{flag:?}");
    }
}

#[test]
fn every_level_is_reached_and_cleared_as_the_table_says() {
    for rule in &TABLE {
        for (level, (reaction, clear)) in rule.levels.iter().enumerate() {
            let mut supervisor = supervisor();
            let flag = Flags::of(rule.flag);
            let severe = if level > 0 && !rule.escalates {
                flag
            } else {
                Flags::NONE
            };
            let mut now = 0.0;
            for _ in 0..=level {
                supervisor.update(&Event {
                    source: rule.source,
                    time: now,
                    travel: 0.0,
                    raised: flag,
                    severe,
                    open: Flags::NONE,
                });
                now += 4.0;
            }
            assert_eq!(supervisor.now().reaction, *reaction, "{rule:?}");
            assert_eq!(supervisor.now().latched, flag);
            assert_eq!(supervisor.now().flags, flag);
            let good = |supervisor: &mut Supervisor<3>, count: u32| {
                for _ in 0..count {
                    supervisor.update(&event(rule.source, now, 0.0, Flags::NONE));
                }
            };
            match clear {
                Clear::Auto => {
                    let needed = if rule.source == Source::Frame { 5 } else { 200 };
                    supervisor.engage();
                    good(&mut supervisor, needed - 1);
                    assert_eq!(supervisor.now().reaction, *reaction, "{rule:?}");
                    good(&mut supervisor, 1);
                }
                Clear::Engage => {
                    good(&mut supervisor, 1000);
                    assert_eq!(supervisor.now().reaction, *reaction, "{rule:?}");
                    supervisor.engage();
                }
                Clear::Restart => {
                    good(&mut supervisor, 1000);
                    supervisor.engage();
                    supervisor.acknowledge();
                    assert_eq!(supervisor.now().reaction, *reaction, "{rule:?}");
                    continue;
                }
            }
            assert_eq!(supervisor.now().reaction, Reaction::None, "{rule:?}");
            assert_eq!(
                supervisor.now().latched,
                flag,
                "a warning stays until it is acknowledged"
            );
            supervisor.acknowledge();
            assert!(supervisor.now().latched.is_empty());
        }
    }
}

#[test]
fn a_hold_ends_by_time_or_travel_and_compensation_returns_with_motion_once_the_cause_is_gone() {
    let frozen = Flags::of(Flag::Frozen);
    let mut by_travel = supervisor();
    by_travel.update(&event(Source::Frame, 0.0, 0.0, frozen));
    by_travel.update(&event(Source::Tick, 0.1, 3.9, Flags::NONE));
    by_travel.update(&event(Source::Frame, 0.1, 0.0, frozen));
    assert_eq!(by_travel.now().reaction, Reaction::HoldEstimate);
    by_travel.update(&event(Source::Tick, 0.2, 0.2, Flags::NONE));
    by_travel.update(&event(Source::Frame, 0.2, 0.0, frozen));
    assert_eq!(by_travel.now().reaction, Reaction::Fade);

    let mut supervisor = supervisor();
    supervisor.update(&event(Source::Frame, 0.0, 0.0, frozen));
    supervisor.update(&event(Source::Frame, 4.0, 0.0, frozen));
    assert_eq!(supervisor.now().reaction, Reaction::Fade);
    // Time alone changes nothing.
    supervisor.update(&event(Source::Tick, 1000.0, 0.0, Flags::NONE));
    assert!((supervisor.now().lead - 1.0).abs() < 1e-12);
    supervisor.update(&event(Source::Tick, 1000.0, 0.5, Flags::NONE));
    assert!((supervisor.now().lead - 0.75).abs() < 1e-12);
    for _ in 0..5 {
        supervisor.update(&event(Source::Frame, 1000.0, 0.0, Flags::NONE));
    }
    assert_eq!(supervisor.now().reaction, Reaction::None);
    supervisor.update(&event(Source::Tick, 1001.0, 0.0, Flags::NONE));
    assert!((supervisor.now().lead - 0.75).abs() < 1e-12);
    supervisor.update(&event(Source::Tick, 1001.0, 0.3, Flags::NONE));
    assert!((supervisor.now().lead - 0.9).abs() < 1e-12);
    assert_eq!(supervisor.now().latched, frozen, "the warning stays");
    // While the estimate is held again, the share stays.
    supervisor.update(&event(Source::Frame, 1001.0, 0.0, frozen));
    supervisor.update(&event(Source::Tick, 1002.0, 1.0, Flags::NONE));
    assert_eq!(supervisor.now().reaction, Reaction::HoldEstimate);
    assert!((supervisor.now().lead - 0.9).abs() < 1e-12);
    for _ in 0..5 {
        supervisor.update(&event(Source::Frame, 1002.0, 0.0, Flags::NONE));
    }
    supervisor.update(&event(Source::Tick, 1001.0, 9.0, Flags::NONE));
    assert!((supervisor.now().lead - 1.0).abs() < 1e-12);
}

/// A hold is over when its time or its travel is reached.
#[test]
fn a_hold_ends_on_its_bound() {
    let frozen = Flags::of(Flag::Frozen);
    let settings = safety();
    for (time, travel, expected) in [
        (settings.hold_time, 0.0, Reaction::Fade),
        (0.0, settings.hold_travel, Reaction::Fade),
        (0.999 * settings.hold_time, 0.0, Reaction::HoldEstimate),
        (0.0, 0.999 * settings.hold_travel, Reaction::HoldEstimate),
    ] {
        let mut supervisor = supervisor();
        supervisor.update(&event(Source::Frame, 0.0, 0.0, frozen));
        supervisor.update(&event(Source::Frame, time, travel, frozen));
        assert_eq!(supervisor.now().reaction, expected, "{time} s, {travel}");
    }
}

/// A flag of the rig before the first tick, which has no time.
#[test]
fn a_hold_that_begins_before_the_first_tick_counts_from_the_next_event() {
    let (fault, hold) = (Flags::of(Flag::DriveFault), safety().hold_time);
    let mut supervisor = supervisor();
    for (time, expected) in [
        (f64::NAN, Reaction::QuickStop),
        (5.0, Reaction::QuickStop),
        (5.0 + hold, Reaction::Disable),
    ] {
        supervisor.update(&event(Source::Rig, time, 0.0, fault));
        assert_eq!(supervisor.now().reaction, expected, "{time} s");
    }
}

#[test]
fn an_event_that_says_nothing_of_a_flag_does_not_clear_it() {
    let frozen = Flags::of(Flag::Frozen);
    let mut supervisor = supervisor();
    supervisor.update(&event(Source::Frame, 0.0, 0.0, frozen));
    for _ in 0..100 {
        supervisor.update(&Event {
            open: frozen,
            ..event(Source::Frame, 1.0, 0.0, Flags::NONE)
        });
    }
    assert_eq!(supervisor.now().flags, frozen);
    for _ in 0..safety().good_frames {
        supervisor.update(&event(Source::Frame, 1.0, 0.0, Flags::NONE));
    }
    assert!(supervisor.now().flags.is_empty());
}

#[test]
fn settings_out_of_range_are_named() {
    type Change = fn(&mut SafetySettings);
    let changes: [(&str, Change); 6] = [
        ("hold_time", |s| s.hold_time = -1.0),
        ("hold_travel", |s| s.hold_travel = f64::NAN),
        ("fade_travel", |s| s.fade_travel = 0.0),
        ("restore_travel", |s| s.restore_travel = 0.0),
        ("good_frames", |s| s.good_frames = 0),
        ("good_ticks", |s| s.good_ticks = 0),
    ];
    for (field, change) in changes {
        let mut wrong = safety();
        change(&mut wrong);
        assert_eq!(Supervisor::new(&wrong).unwrap_err().field, field);
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn any_events_keep_the_gain_share_from_0_to_1_and_change_it_with_motion_only(actions in actions()) {
        let (mut supervisor, mut now) = (supervisor(), 0.0);
        for action in actions {
            let before = supervisor.now().lead;
            apply(&mut supervisor, &mut now, &action, Flags::NONE);
            let share = supervisor.now().lead;
            prop_assert!((0.0..=1.0).contains(&share));
            let passes = supervisor.now().reaction == Reaction::PassThrough;
            let still = !matches!(action, Action::Update(_, _, travel, _, _) if travel > 0.0);
            prop_assert!(passes || !still || (share - before).abs() == 0.0);
            prop_assert!(!supervisor.now().flags.is_empty() || supervisor.now().reaction == Reaction::None);
        }
    }

    /// The share falls and rises with the travel alone, however often the cause comes and goes, and never by more.
    #[test]
    fn a_cause_that_comes_and_goes_changes_the_share_by_the_travel_alone(
        flag in prop::sample::select(&[Flag::Frozen, Flag::Lost, Flag::Merged, Flag::LimitCycle]),
        phases in prop::collection::vec((0.0..3.0_f64, 1..60_u32, any::<bool>()), 1..40),
    ) {
        let settings = safety();
        let least = settings.fade_travel.min(settings.restore_travel);
        let (mut supervisor, mut now) = (supervisor(), 0.0);
        for (travel, frames, is_present) in phases {
            let raised = Flags::when(is_present, flag);
            for _ in 0..frames {
                now += 0.04;
                let before = supervisor.now().lead;
                supervisor.update(&event(Source::Frame, now, 0.0, raised));
                prop_assert_eq!(supervisor.now().lead, before, "a frame moves nothing");
                let moved = travel / f64::from(frames);
                supervisor.update(&event(Source::Tick, now, moved, Flags::NONE));
                let change = supervisor.now().lead - before;
                prop_assert!(change.abs() <= moved / least + 1e-12);
                prop_assert!((0.0..=1.0).contains(&supervisor.now().lead));
                match supervisor.now().reaction {
                    Reaction::Fade => prop_assert!(change <= 0.0),
                    Reaction::None | Reaction::Warn => prop_assert!(change >= 0.0),
                    _ => prop_assert_eq!(change, 0.0),
                }
            }
        }
        // Where the cause has gone, all of the compensation returns.
        for _ in 0..5 {
            supervisor.update(&event(Source::Frame, now, 0.0, Flags::NONE));
        }
        supervisor.update(&event(Source::Tick, now, settings.restore_travel, Flags::NONE));
        prop_assert_eq!(supervisor.now().lead, 1.0);
    }

    /// With one more flag raised at every event, the reaction is never weaker.
    #[test]
    fn more_flags_never_weaken_the_reaction(
        actions in actions(), extra in prop::sample::select(Flag::ALL)
    ) {
        let (mut with, mut without) = (supervisor(), supervisor());
        let (mut now, mut again) = (0.0, 0.0);
        for action in actions {
            apply(&mut with, &mut now, &action, Flags::of(extra));
            apply(&mut without, &mut again, &action, Flags::NONE);
            // Re-engaging clears a flag that stops motion, and not a weaker one.
            if matches!(action, Action::Update(..)) {
                prop_assert!(with.now().reaction >= without.now().reaction);
            }
        }
    }
}
