//! The frame rate: what is another one, and what is not.

use crate::supervision::frame_rate::FrameRate;
use proptest::prelude::*;

const INTERVAL: f64 = 0.04;

proptest! {
    #[test]
    fn a_steady_rate_with_jitter_and_missing_frames_is_usual(
        jitter in 0.0..0.4, every in 16..100_u32, draws in prop::collection::vec(-1.0..1.0, 600),
    ) {
        let mut rate = FrameRate::NEW;
        for (tick, shift) in (0_u32..).zip(draws) {
            let time = 7.0 + (f64::from(tick) + jitter * shift) * INTERVAL;
            prop_assert!(tick % every == 1 || !rate.update(time));
        }
    }

    #[test]
    fn another_rate_is_told_within_a_second_and_becomes_usual(
        ratio in prop_oneof![0.2..0.7, 1.4..4.0], jitter in 0.0..0.05,
        draws in prop::collection::vec(-1.0..1.0, 1200),
    ) {
        let mut rate = FrameRate::NEW;
        let (mut time, mut told) = (0.0, Vec::new());
        for (tick, shift) in draws.iter().enumerate() {
            time += if tick < 200 { INTERVAL } else { ratio * INTERVAL };
            if rate.update(time + jitter * INTERVAL * shift) {
                told.push(tick);
            }
        }
        prop_assert!(told.first().is_some_and(|first| (200..225).contains(first)));
        prop_assert!(told.last().is_some_and(|last| *last < 1000));
    }
}

#[test]
fn pauses_stamps_out_of_order_and_clocks_set_back_are_no_rate() {
    let mut rate = FrameRate::NEW;
    let mut time = 0.0;
    for tick in 0..400 {
        time += INTERVAL;
        if tick % 97 == 96 {
            time += 5.0;
        }
        if tick == 300 {
            time -= 3600.0;
        }
        assert!(!rate.update(time), "{tick}");
        if tick % 10 == 0 {
            assert!(
                !rate.update(time - 0.3 * INTERVAL) && !rate.update(f64::NAN),
                "{tick}"
            );
        }
    }
}
