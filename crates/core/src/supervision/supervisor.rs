//! Which reaction is in force when images, reference or drives cannot be trusted.

use crate::error::{ConfigError, require, require_non_negative, require_positive};
use crate::supervision::flags::Flags;
use crate::supervision::reactions::{Clear, Reaction, Rule, Source, TABLE};
use crate::supervision::settings::SafetySettings;

/// The bounds of the table's reactions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupervisorSettings {
    /// Longest time on a rung, in s.
    pub hold_time: f64,
    /// Longest travel on a rung.
    pub hold_travel: f64,
    /// Travel over which the compensation fades from whole to nothing.
    pub fade_travel: f64,
    /// Travel over which it comes back.
    pub restore_travel: f64,
    /// Good frames in a row that clear a flag of frames.
    pub good_frames: u32,
    /// Good ticks in a row that clear a flag of ticks.
    pub good_ticks: u32,
}

/// What was noticed in a control tick or a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Tick or frame; both may raise any flag.
    pub source: Source,
    /// On the clock of the control tick, in s.
    pub time: f64,
    /// How far the reference has moved since the last event.
    pub travel: f64,
    /// What is wrong.
    pub raised: Flags,
    /// That of it which goes to the last rung at once.
    pub severe: Flags,
}

/// Which reaction is in force: a function of the events so far, and of nothing else.
///
/// Travel is without unit: the sum over the DOFs of |du| over the largest width, so that 1 is about one crossing of
/// the slack.
///
/// ```text
/// lead <- lead - travel / fade_travel       while fading
/// lead <- lead + travel / restore_travel    otherwise, once every warning has been acknowledged
/// ```
///
/// the share of the free gain in use, 0 to 1. Time alone never changes it: without motion nothing moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supervisor {
    settings: SupervisorSettings,
    standing: [Option<Standing>; TABLE.len()],
    /// Of all that stands.
    reaction: Reaction,
    flags: Flags,
    latched: Flags,
    lead: f64,
    time: f64,
    travel: f64,
}

/// Where a flag stands on its ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Standing {
    rung: usize,
    since: f64,
    since_travel: f64,
    good: u32,
}

impl Supervisor {
    /// Nothing noticed yet.
    ///
    /// # Errors
    /// A travel is not above 0, a time or the travel of a hold negative, a count 0, or one not finite.
    pub fn new(safety: &SafetySettings) -> Result<Self, ConfigError> {
        let settings = SupervisorSettings {
            hold_time: safety.hold_time,
            hold_travel: safety.hold_travel,
            fade_travel: safety.fade_travel,
            restore_travel: safety.restore_travel,
            good_frames: safety.good_frames,
            good_ticks: safety.good_ticks,
        };
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
            settings,
            standing: [None; TABLE.len()],
            reaction: Reaction::None,
            flags: Flags::NONE,
            latched: Flags::NONE,
            lead: 1.0,
            time: f64::NEG_INFINITY,
            travel: 0.0,
        })
    }

    /// Take in an event. A time that is not finite counts as the last one, such a travel as none.
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
        for (rule, standing) in TABLE.iter().zip(&mut self.standing) {
            let now = (self.time, self.travel);
            if take(standing, rule, &self.settings, event, now) {
                self.latched = self.latched.union(Flags::of(rule.flag));
            }
        }
        self.sum_up();
        self.move_lead(travel);
    }

    fn move_lead(&mut self, travel: f64) {
        match self.reaction {
            Reaction::Fade => {
                self.lead = (self.lead - travel / self.settings.fade_travel).max(0.0);
            }
            Reaction::PassThrough => self.lead = 0.0,
            Reaction::None | Reaction::Warn | Reaction::HoldEstimate => {
                if self.lead < 1.0 && self.latched.is_empty() {
                    self.lead = (self.lead + travel / self.settings.restore_travel).min(1.0);
                }
            }
            Reaction::HoldMotion | Reaction::QuickStop | Reaction::Disable => {}
        }
    }

    /// The operator has the instrument and the master in view and goes on.
    pub fn engage(&mut self) {
        for (rule, standing) in TABLE.iter().zip(&mut self.standing) {
            if standing.is_some_and(|standing| standing.clear(rule) == Some(Clear::Engage)) {
                *standing = None;
            }
        }
        self.sum_up();
    }

    // Unrolled over the table wherever it is called, it would take minutes to compile.
    #[inline(never)]
    fn sum_up(&mut self) {
        (self.reaction, self.flags) = (Reaction::None, Flags::NONE);
        for (rule, standing) in TABLE.iter().zip(&self.standing) {
            if let Some(standing) = standing {
                self.flags = self.flags.union(Flags::of(rule.flag));
                if let Some((reaction, _)) = rule.ladder.get(standing.rung) {
                    self.reaction = self.reaction.max(*reaction);
                }
            }
        }
    }

    /// The operator has seen the warnings.
    pub const fn acknowledge(&mut self) {
        self.latched = Flags::NONE;
    }

    /// The highest reaction of all flags in force.
    pub const fn reaction(&self) -> Reaction {
        self.reaction
    }

    /// The flags in force.
    pub const fn flags(&self) -> Flags {
        self.flags
    }

    /// What has been raised since the last acknowledgement.
    pub const fn latched(&self) -> Flags {
        self.latched
    }

    /// Share of the free gain in use, 0 to 1.
    pub const fn lead(&self) -> f64 {
        self.lead
    }
}

/// What an event makes of a flag; whether it climbed, or is new.
// As above.
#[inline(never)]
fn take(
    standing: &mut Option<Standing>,
    rule: &Rule,
    settings: &SupervisorSettings,
    event: &Event,
    (time, travel): (f64, f64),
) -> bool {
    let severe = event.severe.contains(rule.flag);
    if severe || event.raised.contains(rule.flag) {
        let start = if severe { rule.ladder.len() - 1 } else { 0 };
        let rung = standing.map_or(start, |now| {
            now.next(rule, settings, time, travel).max(start)
        });
        if let Some(now) = standing
            && now.rung == rung
        {
            now.good = 0;
            // A clock that was set back starts the hold afresh.
            now.since = now.since.min(time);
            return false;
        }
        *standing = Some(Standing {
            rung,
            since: time,
            since_travel: travel,
            good: 0,
        });
        return true;
    }
    if let Some(now) = standing
        && event.source == rule.source
    {
        let needed = match rule.source {
            Source::Frame => settings.good_frames,
            Source::Tick | Source::Rig => settings.good_ticks,
        };
        now.good = now.good.saturating_add(1);
        if now.good >= needed && now.clear(rule) == Some(Clear::Auto) {
            *standing = None;
        }
    }
    false
}

impl Standing {
    /// The rung on which a flag stands that is raised again.
    fn next(&self, rule: &Rule, settings: &SupervisorSettings, time: f64, travel: f64) -> usize {
        let over = time - self.since >= settings.hold_time
            || travel - self.since_travel >= settings.hold_travel;
        if rule.climbs && over {
            (self.rung + 1).min(rule.ladder.len() - 1)
        } else {
            self.rung
        }
    }

    fn clear(&self, rule: &Rule) -> Option<Clear> {
        rule.ladder.get(self.rung).map(|(_, clear)| *clear)
    }
}
