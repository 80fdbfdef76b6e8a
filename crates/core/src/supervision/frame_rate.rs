//! Frame rate: whether images or measurements still come as often as before.

/// Frames of the recent mean, and of the usual one.
const RECENT: f64 = 16.0;
const USUAL: f64 = 200.0;
/// Frames after which the usual spacing is known.
const KNOWN: f64 = 50.0;
/// Change of the spacing, over the usual one, that counts: one frame that is missing changes the recent mean by 1/16.
const CHANGE: f64 = 0.1;
/// Longest spacing in s; a longer one is a pause.
const PAUSE: f64 = 1.0;

/// Compares the spacing of time stamps with the usual one.
///
/// ```text
/// recent <- recent + (t - t0 - recent) / 16,    |recent - usual| > 0.1 usual + spread
/// ```
///
/// with the stamps t and t0 of two frames in a row, and the mean spacing and its mean absolute deviation over the last 200. A
/// new rate is the usual one after some 100 frames.
///
/// Blind to a clock that has always been wrong, and to a change of rate within the spread of the stamps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameRate {
    last: f64,
    count: f64,
    recent: f64,
    usual: f64,
    spread: f64,
}

impl FrameRate {
    /// Before the first frame.
    pub const NEW: Self = Self {
        last: f64::NAN,
        count: 0.0,
        recent: 0.0,
        usual: 0.0,
        spread: 0.0,
    };

    /// Whether frames come at another rate than usual, with a frame of this time stamp in s.
    pub fn update(&mut self, captured_at: f64) -> bool {
        let spacing = captured_at - self.last;
        if spacing > 0.0 && spacing < PAUSE {
            if self.count == 0.0 {
                self.recent = spacing;
            }
            self.count = (self.count + 1.0).min(USUAL);
            self.recent += (spacing - self.recent) / RECENT;
            self.usual += (spacing - self.usual) / self.count;
            self.spread += ((spacing - self.usual).abs() - self.spread) / self.count;
        }
        // A frame out of order is none of the next spacing; a clock that was set back is.
        if captured_at.is_finite() && !(-PAUSE..=0.0).contains(&spacing) {
            self.last = captured_at;
        }
        let change = (self.recent - self.usual).abs();
        self.count >= KNOWN && change > CHANGE * self.usual + self.spread
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
}
