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
