//! What the peer sent and received, and the figures of it.

use std::collections::HashMap;
use std::time::Instant;

/// The positions of a message, bit by bit.
pub type Bits = [u64; 3];

/// What was sent and received, for the figures.
#[derive(Default)]
pub struct Record {
    pub sent: HashMap<Bits, Instant>,
    pub references: u64,
    pub images: u64,
    pub setpoints: HashMap<i64, Bits>,
    pub arrivals: HashMap<i64, Instant>,
    pub commands: u64,
    pub missed_commands: i64,
    pub last_sequence: Option<i64>,
    pub last_command: Option<Bits>,
    pub last_reference: Option<Instant>,
    pub changed_at: Option<Instant>,
    pub received_at: Option<Instant>,
    pub largest_gap: f64,
    pub is_stopped: bool,
}

impl Record {
    /// How long the commands changed after the last reference [s]; NaN if they did not.
    pub fn motion_after_the_last_reference(&self) -> f64 {
        match (self.changed_at, self.last_reference) {
            (Some(changed), Some(sent)) => changed.saturating_duration_since(sent).as_secs_f64(),
            _ => f64::NAN,
        }
    }

    /// Counts, and delays between a reference and its command [s], as JSON; a reference counts once.
    pub fn report(&mut self) -> String {
        // Set-points and commands are published once per tick, so that they have the same numbers.
        let Self {
            setpoints,
            arrivals,
            sent,
            ..
        } = self;
        let mut found: Vec<f64> = arrivals
            .iter()
            .filter_map(|(number, arrival)| Some((arrival, sent.remove(setpoints.get(number)?)?)))
            .map(|(arrival, sent)| arrival.saturating_duration_since(sent).as_secs_f64())
            .collect();
        found.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            found
                .get((share * (found.len() as f64 - 1.0)) as usize)
                .copied()
                .unwrap_or(0.0)
        };
        format!(
            "{{\"event\": \"report\", \"references\": {}, \"images\": {}, \"commands\": {}, \"missed_commands\": {}, \
             \"matched\": {}, \"p50\": {}, \"p99\": {}, \"p999\": {}, \"max\": {}, \"largest_gap\": {}}}",
            self.references,
            self.images,
            self.commands,
            self.missed_commands,
            found.len(),
            quantile(0.5),
            quantile(0.99),
            quantile(0.999),
            quantile(1.0),
            self.largest_gap,
        )
    }
}
