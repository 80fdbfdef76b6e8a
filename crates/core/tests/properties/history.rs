//! The command in force when a frame was captured.

use crate::estimation::history::{Entry, History, history_entries};
use proptest::prelude::*;

use super::{close, config};

const PERIOD: f64 = 0.005;

fn entry(time: f64) -> Entry {
    Entry {
        time,
        reference: [-2.0 * time; 3],
        command: [time, 2.0 * time, -time],
        predicted_state: [3.0 * time, time, 0.5],
        corrected: [0.5 * time; 3],
        travel: [time; 3],
    }
}

fn filled(span: f64, ticks: u32) -> History<Vec<Entry>> {
    let storage = vec![Entry::BLANK; history_entries(span, PERIOD)];
    let mut history = History::new(span, PERIOD, storage).unwrap();
    for tick in 0..ticks {
        assert!(!history.push(entry(f64::from(tick) * PERIOD)));
    }
    history
}

#[test]
fn a_full_ring_covers_less_than_the_span_where_ticks_are_faster() {
    for share in [0.2, 0.5, 1.0, 2.0] {
        let storage = vec![Entry::BLANK; history_entries(5.0, PERIOD)];
        let mut history = History::new(5.0, PERIOD, storage).unwrap();
        for tick in 0..6000 {
            history.push(entry(f64::from(tick) * share * PERIOD));
        }
        let (newest, covered) = (history.newest_time(), history.covered());
        assert!(history.at(newest - covered).is_some());
        assert!(close(covered, (5.0_f64).min(1001.0 * share * PERIOD)));
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn entries_are_interpolated_between_ticks(ticks in 2_u32..3000, share in 0.0..1.0) {
        let history = filled(5.0, ticks);
        let newest = f64::from(ticks - 1) * PERIOD;
        let kept = f64::from((ticks - 1).min(1000)) * PERIOD;
        let time = newest - share * (kept - 1e-9);
        let found = history.at(time).unwrap();
        let expected = entry(time);
        for (found, expected) in [
            (found.command, expected.command),
            (found.predicted_state, expected.predicted_state),
        ] {
            prop_assert!(found.iter().zip(expected).all(|(a, b)| close(*a, b)));
        }
    }

    /// Against a list that is searched from its start. Times are multiples of 2^-4, span and period of 2^-3.
    #[test]
    fn a_history_agrees_with_a_plain_list(
        steps in prop::collection::vec((-6..12_i32, -1.0..1.0_f64), 1..60), spare in 0_usize..3,
        late in 0..30_i32
    ) {
        let (span, period) = (1.0, 0.125);
        let capacity = 10 + spare;
        let mut history = History::new(span, period, vec![Entry::BLANK; capacity]).unwrap();
        prop_assert!(history.newest_time().is_nan() && history.since(-1e9).next().is_none());
        let mut list: Vec<Entry> = Vec::new();
        let mut now = 0;
        for (step, value) in steps {
            // Most steps are one period forward; some repeat the time, and few go back.
            now += match step { -6 => -7, -5..0 => 0, other => other.min(2) };
            let new = Entry {
                command: [value, -value, 2.0 * value],
                reference: [value; 3],
                ..entry(f64::from(now) / 16.0)
            };
            let newest = list.last().map(|last| last.time);
            let is_back = newest.is_some_and(|newest| new.time < newest);
            if is_back {
                list.clear();
            } else if newest == Some(new.time) {
                list.pop();
            }
            list.push(new);
            if list.len() > capacity {
                list.remove(0);
            }
            prop_assert_eq!(history.push(new), is_back);
        }
        let newest = *list.last().unwrap();
        prop_assert_eq!(history.newest_time(), newest.time);
        let time = newest.time + (f64::from(3 - late)) / 16.0;
        let after: Vec<Entry> = list.iter().copied().filter(|entry| entry.time > time).collect();
        prop_assert_eq!(history.since(time).copied().collect::<Vec<_>>(), after);
        let found = history.at(time);
        let before = list.iter().rev().find(|entry| entry.time <= time);
        let next = list.iter().find(|entry| entry.time > time);
        let is_kept = time >= newest.time - span && time <= newest.time + period;
        match (before.filter(|_| is_kept), next) {
            (None, _) => prop_assert_eq!(found, None),
            (Some(before), None) => prop_assert_eq!(found, Some(Entry { time, ..*before })),
            (Some(before), Some(next)) => {
                let found = found.unwrap();
                let share = (time - before.time) / (next.time - before.time);
                let mix = |of: fn(&Entry) -> [f64; 3]| {
                    let (from, to, found) = (of(before), of(next), of(&found));
                    (0..3).all(|k| close(found[k], (1.0 - share) * from[k] + share * to[k]))
                };
                prop_assert!(mix(|entry| entry.reference) && mix(|entry| entry.command));
                prop_assert!(mix(|entry| entry.predicted_state) && mix(|entry| entry.corrected));
                prop_assert!(mix(|entry| entry.travel) && found.time == time);
            }
        }
    }
}

/// Values so far apart that interpolation from the entry before would round.
#[test]
fn at_the_time_of_an_entry_it_is_that_entry_bit_for_bit() {
    let mut history = filled(2.0, 0);
    let ticks: Vec<Entry> = (0..16)
        .map(|tick| Entry {
            command: [if tick % 2 == 0 { 1e17 } else { 1.0 }; 3],
            ..entry(f64::from(tick) / 256.0)
        })
        .collect();
    for tick in &ticks {
        history.push(*tick);
    }
    for tick in ticks {
        assert_eq!(history.at(tick.time).unwrap().command, tick.command);
    }
}

#[test]
fn an_entry_needs_finite_values() {
    for spoil in [f64::NAN, f64::INFINITY] {
        let mut history = filled(2.0, 3);
        history.push(Entry {
            predicted_state: [0.0, spoil, 0.0],
            ..entry(1.0)
        });
        history.push(Entry {
            time: spoil,
            ..entry(1.0)
        });
        assert_eq!(history.newest_time(), 2.0 * PERIOD);
    }
}

#[test]
fn the_storage_is_one_entry_per_period_and_two() {
    assert_eq!(history_entries(1.0, 0.125), 10);
    assert_eq!(history_entries(1.1, 0.125), 11);
    assert_eq!(history_entries(1e300, 1e-5), usize::MAX);
}

#[test]
fn a_history_without_a_period_is_refused() {
    for (span, period) in [(1.0, 0.0), (f64::INFINITY, 0.1), (f64::NAN, 0.1)] {
        let storage = vec![Entry::<3>::BLANK; history_entries(span, period)];
        assert!(History::new(span, period, storage).is_err());
    }
}

#[test]
fn times_outside_the_history_have_no_entry() {
    let history = filled(1.0, 500);
    let newest = 499.0 * PERIOD;
    assert!(history.at(newest - 1.0 + 1e-9).is_some());
    assert!(
        history.at(newest - 1.0 - 1e-9).is_none(),
        "older than the span"
    );
    let mut quick = filled(1.0, 0);
    for tick in 0..400 {
        quick.push(entry(f64::from(tick) * PERIOD / 2.0));
    }
    let now = quick.newest_time();
    assert!(quick.at(now - 0.5).is_some());
    assert!(quick.at(now - 0.6).is_none(), "overwritten");
    assert!(filled(100.0, 3).at(-1e-9).is_none(), "before the first");
    assert_eq!(
        history.at(newest + 0.9 * PERIOD).unwrap().command,
        entry(newest).command
    );
    assert!(
        history.at(newest + 1.1 * PERIOD).is_none(),
        "later than a period"
    );
    assert!(history.at(f64::NAN).is_none());
    assert!(
        History::new(0.5, PERIOD, [Entry::<3>::BLANK; 102])
            .unwrap()
            .at(0.0)
            .is_none(),
        "empty"
    );
}

#[test]
fn a_time_that_jumps_back_clears_the_history() {
    let mut history = filled(2.0, 100);
    assert!(history.push(entry(0.1)));
    assert!(history.at(0.2).is_none());
    assert!(history.at(0.1).is_some() && history.at(0.09).is_none());
}

#[test]
fn equal_times_replace_and_entries_that_are_not_finite_are_ignored() {
    let mut history = filled(2.0, 3);
    let again = Entry {
        command: [7.0; 3],
        ..entry(2.0 * PERIOD)
    };
    assert!(!history.push(again));
    assert_eq!(history.at(2.0 * PERIOD).unwrap().command, [7.0; 3]);
    assert!(close(history.at(PERIOD).unwrap().command[0], PERIOD));
    assert!(!history.push(Entry {
        command: [f64::NAN; 3],
        ..entry(1.0)
    }));
    assert!(!history.push(entry(f64::NAN)));
    assert_eq!(history.at(2.0 * PERIOD).unwrap().command, [7.0; 3]);
}

#[test]
fn bad_spans_are_named() {
    let new = |span, period| History::new(span, period, [Entry::<3>::BLANK; 12]);
    assert_eq!(new(0.0, 0.1).unwrap_err().field, "span");
    assert_eq!(new(1.0, f64::NAN).unwrap_err().field, "period");
    assert!(new(1.0, 0.1).is_ok());
    assert_eq!(new(1.1, 0.1).unwrap_err().field, "history");
}
