//! History of control ticks: a frame is compared with the state at its capture, not at its arrival.

use crate::dof::{all_finite, zip_with};
use crate::error::{ConfigError, require, require_positive};

/// One control tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry<const N: usize = 3> {
    /// Time in s, on the clock of the control tick.
    pub time: f64,
    /// The reference u after the reference gate [m or rad].
    pub reference: [f64; N],
    /// The command c [m or rad].
    pub command: [f64; N],
    /// The predicted state q [m or rad].
    pub predicted_state: [f64; N],
    /// The sum of the changes of q by image updates so far [m or rad].
    pub corrected: [f64; N],
    /// Largest possible travel of the tip so far, the sum of absolute motions [m or rad]: that of its command, or of the
    /// predicted state where another DOF takes up the friction that held the tip.
    pub travel: [f64; N],
}

impl<const N: usize> Entry<N> {
    /// Initial content of the storage of a history.
    pub const BLANK: Self = Self {
        time: 0.0,
        reference: [0.0; N],
        command: [0.0; N],
        predicted_state: [0.0; N],
        corrected: [0.0; N],
        travel: [0.0; N],
    };
}

/// Ring buffer of the latest control ticks in a storage `S`: an array, a vector, or a borrowed slice.
#[derive(Debug, Clone)]
pub struct History<S, const N: usize = 3> {
    ring: S,
    /// Index of the next entry.
    next: usize,
    len: usize,
    span: f64,
    period: f64,
}

impl<S: AsRef<[Entry<N>]> + AsMut<[Entry<N>]>, const N: usize> History<S, N> {
    /// A history of `span` in s for a control tick every `period` in s.
    ///
    /// # Errors
    /// A value is not a finite number above 0, or the storage holds fewer than [`history_entries`] entries.
    pub fn new(span: f64, period: f64, storage: S) -> Result<Self, ConfigError> {
        require_positive("span", span)?;
        require_positive("period", period)?;
        require(
            history_entries(span, period) <= storage.as_ref().len(),
            "history",
            span,
            "a span that the storage holds: two entries and one per control period",
        )?;
        Ok(Self {
            ring: storage,
            next: 0,
            len: 0,
            span,
            period,
        })
    }

    /// Stores a tick; returns whether its time is before the newest one, which clears the history.
    ///
    /// An entry of equal time replaces the newest one. An entry that is not finite is not stored.
    pub fn push(&mut self, entry: Entry<N>) -> bool {
        let finite = all_finite(entry.command) && all_finite(entry.predicted_state);
        if !(finite && entry.time.is_finite()) {
            return false;
        }
        let newest = self.newest().map(|newest| newest.time);
        let jumped = newest.is_some_and(|newest| entry.time < newest);
        if jumped {
            self.len = 0;
        } else if newest == Some(entry.time) {
            self.next = (self.next + self.capacity() - 1) % self.capacity();
            self.len -= 1;
        }
        if let Some(slot) = self.ring.as_mut().get_mut(self.next) {
            *slot = entry;
        }
        self.next = (self.next + 1) % self.capacity();
        self.len = (self.len + 1).min(self.capacity());
        jumped
    }

    /// The entry at `time` in s, interpolated between two ticks.
    ///
    /// None before the oldest tick within the span, more than one period after the newest, and
    /// for a time that is not finite.
    pub fn at(&self, time: f64) -> Option<Entry<N>> {
        let newest = *self.newest()?;
        // Times that count ticks differ by rounding.
        let ahead = self.period * (1.0 + 1e-6);
        if !(time >= newest.time - self.span && time <= newest.time + ahead) {
            return None;
        }
        if time >= newest.time {
            return Some(Entry { time, ..newest });
        }
        // Bisection over the ages 0 (newest, later than `time`) to len - 1 for the youngest that is not later.
        let (mut later, mut sought) = (0, self.len - 1);
        if self.aged(sought)?.time > time {
            return None;
        }
        while sought - later > 1 {
            let middle = usize::midpoint(later, sought);
            if self.aged(middle)?.time > time {
                later = middle;
            } else {
                sought = middle;
            }
        }
        let (before, after) = (self.aged(sought)?, self.aged(later)?);
        let share = (time - before.time) / (after.time - before.time);
        let between = |a, b| zip_with(a, b, |a: f64, b: f64| a + share * (b - a));
        Some(Entry {
            time,
            reference: between(before.reference, after.reference),
            command: between(before.command, after.command),
            predicted_state: between(before.predicted_state, after.predicted_state),
            corrected: between(before.corrected, after.corrected),
            travel: between(before.travel, after.travel),
        })
    }

    /// Time that it covers, in s.
    pub const fn span(&self) -> f64 {
        self.span
    }

    /// Time that it covers when it is full, in s: less than the span where ticks are faster than the period.
    pub fn covered(&self) -> f64 {
        let oldest = self.aged(self.capacity() - 1);
        oldest.map_or(self.span, |oldest| {
            self.span.min(self.newest_time() - oldest.time)
        })
    }

    /// The ticks after `time`, oldest first.
    pub fn since(&self, time: f64) -> impl Iterator<Item = &Entry<N>> + Clone {
        let count = (0..self.len)
            .take_while(|age| self.aged(*age).is_some_and(|entry| entry.time > time))
            .count();
        (0..count).rev().filter_map(|age| self.aged(age))
    }

    /// The time of the newest tick in s; NaN if the history is empty.
    pub fn newest_time(&self) -> f64 {
        self.newest().map_or(f64::NAN, |newest| newest.time)
    }

    fn newest(&self) -> Option<&Entry<N>> {
        self.aged(0)
    }

    fn aged(&self, age: usize) -> Option<&Entry<N>> {
        let place = (self.next + self.capacity() - 1).checked_sub(age)? % self.capacity();
        self.ring.as_ref().get(place).filter(|_| age < self.len)
    }

    fn capacity(&self) -> usize {
        self.ring.as_ref().len()
    }
}

/// Entries that a history of `span` in s needs for a control tick every `period` in s: from the last tick before the
/// span to the newest. Two where that is no finite number, as of a period of 0, which `History::new` refuses.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a cast from f64 saturates"
)]
pub fn history_entries(span: f64, period: f64) -> usize {
    let periods = libm::ceil(span / period);
    let periods = if periods.is_finite() {
        periods as usize
    } else {
        0
    };
    periods.saturating_add(2)
}
