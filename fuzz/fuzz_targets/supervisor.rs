//! Any sequence of events into the supervisor: it never panics, and its lead stays a share.
#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use tautscope_core::{Event, Flag, Flags, Reaction, Source, Supervisor, SupervisorSettings};

#[derive(Arbitrary, Debug)]
enum Action {
    Update {
        source: u8,
        time: f64,
        travel: f64,
        raised: u32,
        severe: u32,
    },
    Engage,
    Acknowledge,
}

fn flags(bits: u32) -> Flags {
    let each = Flag::ALL.iter().enumerate();
    each.filter(|(place, _)| bits >> place & 1 == 1)
        .fold(Flags::NONE, |all, (_, flag)| all.and(Flags::of(*flag)))
}

fuzz_target!(|actions: Vec<Action>| {
    let mut supervisor = Supervisor::new(SupervisorSettings {
        hold_time: 4.0,
        hold_travel: 4.0,
        fade_travel: 2.0,
        restore_travel: 2.0,
        good_frames: 5,
        good_ticks: 200,
    })
    .unwrap();
    for action in actions {
        match action {
            Action::Update {
                source,
                time,
                travel,
                raised,
                severe,
            } => {
                let raised = flags(raised);
                supervisor.update(&Event {
                    source: [Source::Tick, Source::Frame, Source::Rig][usize::from(source % 3)],
                    time,
                    travel,
                    raised,
                    severe: flags(severe),
                });
                assert!(raised.without(supervisor.flags()).is_empty());
            }
            Action::Engage => supervisor.engage(),
            Action::Acknowledge => supervisor.acknowledge(),
        }
        assert!((0.0..=1.0).contains(&supervisor.lead()));
        assert_eq!(
            supervisor.flags().is_empty(),
            supervisor.reaction() == Reaction::None
        );
    }
});
