//! Rate limit of the estimated offsets in the compensation, against erroneous measurements.

use crate::dof::PerDof;
use crate::model::hysteresis::Hysteresis;

/// Limits how fast the compensation follows a change of the estimated hysteresis.
///
/// ```text
/// w <- w + g, then towards 0 by rate t         w: lag of the value in use; g: change of half width or centre by an image
/// used: estimate - w                           t: time in which the reference moved
/// ```
///
/// A scope changes its slack within seconds; erroneous images do so at once. What was estimated stays as it is, so that
/// correct images take it back at once. Until the reference has travelled `known_travel` nothing is limited.
///
/// Wrong while the slack of an instrument does change faster: by the difference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetRateLimit {
    rate: PerDof<f64>,
    period: f64,
    known_travel: f64,
    half_width: PerDof<f64>,
    centre: PerDof<f64>,
    moving: PerDof<f64>,
    travel: PerDof<f64>,
}

impl OffsetRateLimit {
    /// No limit yet; `rate` (3,) is the largest change per s, `known_travel` is in the unit of `travel` of
    /// [`OffsetRateLimit::step`].
    pub const fn new(rate: PerDof<f64>, known_travel: f64, period: f64) -> Self {
        Self {
            rate,
            period,
            known_travel,
            half_width: [0.0; 3],
            centre: [0.0; 3],
            moving: [0.0; 3],
            travel: [0.0; 3],
        }
    }

    /// A control tick in which each reference travelled so far (3,).
    pub fn step(&mut self, travel: PerDof<f64>) {
        let axes = self.moving.iter_mut().zip(&mut self.travel).zip(travel);
        for ((moving, sum), travel) in axes {
            if travel > 0.0 {
                *moving += self.period;
                *sum += travel;
            }
        }
    }

    /// An image changed the estimate: half widths and centres (3,) at one position before and after.
    pub fn update(&mut self, before: [PerDof<f64>; 2], after: [PerDof<f64>; 2]) {
        let known = self.travel.map(|travel| travel >= self.known_travel);
        let moving = core::mem::take(&mut self.moving);
        let [half_before, centre_before] = before;
        let [half_after, centre_after] = after;
        for (lag, (before, after)) in [
            (&mut self.half_width, (half_before, half_after)),
            (&mut self.centre, (centre_before, centre_after)),
        ] {
            let changes = before.into_iter().zip(after);
            let limits = self.rate.into_iter().zip(moving).zip(known);
            for ((lag, (before, after)), ((rate, moving), known)) in
                lag.iter_mut().zip(changes).zip(limits)
            {
                *lag += after - before;
                let allowed = if known { rate * moving } else { f64::INFINITY };
                *lag -= lag.max(-allowed).min(allowed);
            }
        }
    }

    /// The hysteresis that the compensation uses, for an estimate.
    pub fn apply(&self, estimate: &Hysteresis) -> Hysteresis {
        let mut used = *estimate;
        for (value, lag) in used.half_width.iter_mut().zip(self.half_width) {
            *value = (*value - lag).max(0.0);
        }
        for (value, lag) in used.centre.iter_mut().zip(self.centre) {
            *value -= lag;
        }
        used
    }
}
