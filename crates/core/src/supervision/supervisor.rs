//! The supervisor: which reaction is in force, by the flags that the monitors raise.

use crate::error::{ConfigError, require, require_non_negative, require_positive};
use crate::supervision::flags::Flags;
use crate::supervision::reactions::{Clear, Reaction, Rule, Source, TABLE};
use crate::supervision::settings::SafetySettings;

/// What the monitors found at a control tick or in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Where the event comes from; any source may raise any flag.
    pub source: Source,
    /// Time of the control tick, in s.
    pub time: f64,
    /// Travel of the reference since the last event [in `width_limit`].
    pub travel: f64,
    /// The flags that are raised.
    pub raised: Flags,
    /// The flags that go to their last level at once.
    pub severe: Flags,
    /// The flags of which the event says nothing: another sensor raised them.
    pub open: Flags,
}

/// Selects the reaction in force from the events so far, and from nothing else.
///
/// Travel is dimensionless: the sum over the DOFs of |du| over `width_limit`, so that 1 is about one crossing of the
/// slack.
///
/// ```text
/// lead <- lead - travel / fade_travel       while fading
/// lead <- lead + travel / restore_travel    while nothing more severe than a warning is in force
/// ```
///
/// is the share of the chosen compensation that is allowed, 0 to 1. It changes with motion only, never with time, so that nothing moves by
/// itself; while the estimate or motion is held, it stays. Compensation returns without an acknowledgement, which only
/// clears the list of warnings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supervisor<const N: usize> {
    settings: SafetySettings<N>,
    active: [Option<ActiveFlag>; TABLE.len()],
    now: Supervision,
    time: f64,
    travel: f64,
}

/// State of the supervision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supervision {
    /// The reaction in force: the highest of all active flags.
    pub reaction: Reaction,
    /// The flags that cause it.
    pub flags: Flags,
    /// The flags raised or escalated since the last acknowledgement.
    pub latched: Flags,
    /// Share that the supervisor allows of the chosen compensation, 0 to 1.
    pub lead: f64,
}

/// The level of a flag's reaction, since when, and the good events in a row since the flag was raised last.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ActiveFlag {
    level: usize,
    since: f64,
    since_travel: f64,
    good_events: u32,
}

impl<const N: usize> Supervisor<N> {
    /// The supervisor before the first event.
    ///
    /// # Errors
    /// A travel is not above 0, a time or the travel of a hold negative, a count 0, or one not finite.
    pub fn new(settings: &SafetySettings<N>) -> Result<Self, ConfigError> {
        require_non_negative("hold_time", settings.hold_time)?;
        require_non_negative("hold_travel", settings.hold_travel)?;
        require_positive("fade_travel", settings.fade_travel)?;
        require_positive("restore_travel", settings.restore_travel)?;
        for (field, count) in [
            ("good_frames", settings.good_frames),
            ("good_ticks", settings.good_ticks),
        ] {
            require(count > 0, field, f64::from(count), "1 or above")?;
        }
        Ok(Self {
            settings: *settings,
            active: [None; TABLE.len()],
            now: Supervision {
                reaction: Reaction::None,
                flags: Flags::NONE,
                latched: Flags::NONE,
                lead: 1.0,
            },
            time: f64::NEG_INFINITY,
            travel: 0.0,
        })
    }

    /// Update with an event. A time that is not finite counts as the last one, and such a travel as none.
    #[inline(never)]
    pub fn update(&mut self, event: &Event) {
        let travel = if event.travel.is_finite() {
            event.travel.max(0.0)
        } else {
            0.0
        };
        if event.time.is_finite() {
            self.time = event.time;
        }
        self.travel += travel;
        // Without a flag, as in most ticks, there is nothing to update.
        let flags = self.now.flags.union(event.raised).union(event.severe);
        if !flags.is_empty() {
            self.update_flags(event);
        }
        self.update_gain_share(travel);
    }

    fn update_flags(&mut self, event: &Event) {
        let now = (self.time, self.travel);
        for (rule, active) in TABLE.iter().zip(&mut self.active) {
            if update_flag(active, rule, &self.settings, event, now) {
                self.now.latched = self.now.latched.union(Flags::of(rule.flag));
            }
        }
        self.summarize();
    }

    fn update_gain_share(&mut self, travel: f64) {
        let lead = &mut self.now.lead;
        match self.now.reaction {
            Reaction::Fade => *lead = (*lead - travel / self.settings.fade_travel).max(0.0),
            Reaction::PassThrough => *lead = 0.0,
            Reaction::None | Reaction::Warn => {
                *lead = (*lead + travel / self.settings.restore_travel).min(1.0);
            }
            Reaction::HoldEstimate
            | Reaction::HoldMotion
            | Reaction::QuickStop
            | Reaction::Disable => {}
        }
    }

    /// The operator re-engages: clear the flags that need it.
    pub fn engage(&mut self) {
        for (rule, active) in TABLE.iter().zip(&mut self.active) {
            if active.is_some_and(|active| active.clear(rule) == Some(Clear::Engage)) {
                *active = None;
            }
        }
        self.summarize();
    }

    // Unrolled over the table wherever it is called, it would take minutes to compile.
    #[inline(never)]
    fn summarize(&mut self) {
        let now = &mut self.now;
        (now.reaction, now.flags) = (Reaction::None, Flags::NONE);
        for (rule, active) in TABLE.iter().zip(&self.active) {
            if let Some(active) = active {
                now.flags = now.flags.union(Flags::of(rule.flag));
                if let Some((reaction, _)) = rule.levels.get(active.level) {
                    now.reaction = now.reaction.max(*reaction);
                }
            }
        }
    }

    /// The operator acknowledges the warnings.
    pub const fn acknowledge(&mut self) {
        self.now.latched = Flags::NONE;
    }

    /// The state now.
    pub const fn now(&self) -> Supervision {
        self.now
    }
}

/// Update a flag with an event. Returns whether the flag is new or has escalated.
// Not inlined, as above.
#[inline(never)]
fn update_flag<const N: usize>(
    active: &mut Option<ActiveFlag>,
    rule: &Rule,
    settings: &SafetySettings<N>,
    event: &Event,
    (time, travel): (f64, f64),
) -> bool {
    let severe = event.severe.contains(rule.flag);
    if severe || event.raised.contains(rule.flag) {
        let start = if severe { rule.levels.len() - 1 } else { 0 };
        let level = active.map_or(start, |now| {
            now.next_level(rule, settings, time, travel).max(start)
        });
        if let Some(now) = active
            && now.level == level
        {
            now.good_events = 0;
            // A clock that was set back restarts the hold, and the first tick begins it.
            now.since = if now.since.is_finite() {
                now.since.min(time)
            } else {
                time
            };
            return false;
        }
        *active = Some(ActiveFlag {
            level,
            since: time,
            since_travel: travel,
            good_events: 0,
        });
        return true;
    }
    if let Some(now) = active
        && event.source == rule.source
        && !event.open.contains(rule.flag)
    {
        let needed = match rule.source {
            Source::Frame => settings.good_frames,
            Source::Tick | Source::Rig => settings.good_ticks,
        };
        now.good_events = now.good_events.saturating_add(1);
        if now.good_events >= needed && now.clear(rule) == Some(Clear::Auto) {
            *active = None;
        }
    }
    false
}

impl ActiveFlag {
    /// The level of a flag that is raised again.
    fn next_level<const N: usize>(
        &self,
        rule: &Rule,
        settings: &SafetySettings<N>,
        time: f64,
        travel: f64,
    ) -> usize {
        // Before the first tick there is no time.
        let is_over = self.since.is_finite() && time - self.since >= settings.hold_time
            || travel - self.since_travel >= settings.hold_travel;
        if rule.escalates && is_over {
            (self.level + 1).min(rule.levels.len() - 1)
        } else {
            self.level
        }
    }

    fn clear(&self, rule: &Rule) -> Option<Clear> {
        rule.levels.get(self.level).map(|(_, clear)| *clear)
    }
}
