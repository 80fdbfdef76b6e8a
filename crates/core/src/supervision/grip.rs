//! A tip that is in contact goes with its command until the command turns.

/// When a tip counts as in contact, and as having left it; lengths in the unit of the DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GripSettings {
    /// Travel of the command over which the tip must have gone with it.
    pub distance: f64,
    /// How far the tip may be off where its command should have taken it.
    pub slip: f64,
}

/// The same as a share of the command's travel.
const SLIP_SHARE: f64 = 0.15;
/// So often the command turns before slack counts as learnt: both contacts, and one once more.
const LEARNT: u32 = 3;
/// What a command moves by between two images that does not rest, as a share of `distance`: a tip at rest creeps.
const REST: f64 = 0.007;
/// Over so many images it is averaged where a tip in contact is: one alone is off by its own noise from then on.
const LOOKS: u32 = 8;
/// What a command comes back by between two images, or another DOF lets go of, before it has turned, as a share of `slip`.
const TURN: f64 = 0.1;

/// One DOF's contact, told from command c and measured tip m.
///
/// ```text
/// slips   |(c - m) - (c0 - m0)| > slip + 0.15 |c - c0| + deviation
/// or      c - m < least offset - slip - deviation,   c - m > largest offset + slip + deviation
/// ```
///
/// From a turn or rest of the command on, (c0, m0) is where it last slipped. Once it has not over `distance` and eight
/// images the tip is held, (c0, m0) is a fading mean over the last eight, and until the command turns or rests it cannot
/// slip. Nor can slack grow by more than that between two turns: the offsets are those learnt at the last, once it has
/// turned three times. Friction that another DOF takes counts as a turn.
///
/// Without effect where a tip goes less far than its command, or farther: it is never held. Wrong where something else
/// moves the tip: that slips, too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grip {
    settings: GripSettings,
    /// Command and tip it is compared with.
    anchor: Option<(f64, f64)>,
    /// Their mean over the last images since the command turned, rested, or the tip slipped, and of how many.
    lately: (f64, f64),
    looks: u32,
    last: Last,
    is_held: bool,
    /// What was allowed when the command turned or rested last.
    offsets: (f64, f64),
    /// How often the command has turned.
    turns: u32,
}

/// Any offset.
const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// At the last image that was believed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Last {
    command: f64,
    tip: f64,
    travel: f64,
    /// Of the command: -1, 1, or 0 before it moves.
    direction: f64,
}

/// What an image says of a DOF, and where its command was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// The command c.
    pub command: f64,
    /// How far the tip may have gone, as in [`crate::Entry`].
    pub travel: f64,
    /// The tip m as measured; NaN where it was not.
    pub tip: f64,
    /// Its standard deviation.
    pub deviation: f64,
    /// Least and largest c - m that the slack as learnt allows.
    pub offsets: (f64, f64),
}

impl Grip {
    /// Before the first image.
    pub const fn new(settings: GripSettings) -> Self {
        Self {
            settings,
            anchor: None,
            lately: (0.0, 0.0),
            looks: 0,
            last: Last {
                command: 0.0,
                tip: 0.0,
                travel: 0.0,
                direction: 0.0,
            },
            is_held: false,
            offsets: ANY,
            turns: 0,
        }
    }

    /// Whether a held tip would have slipped, or have been left farther behind than there is slack.
    pub fn slips(&self, seen: &Sighting) -> bool {
        let (least, most) = if self.turned(seen) {
            seen.offsets
        } else {
            self.offsets
        };
        let offset = seen.command - seen.tip;
        let spare = self.settings.slip + seen.deviation;
        let is_behind = self.turns >= LEARNT && (offset < least - spare || offset > most + spare);
        is_behind || self.is_held && !self.turned(seen) && self.is_off(seen)
    }

    /// An image was believed.
    pub fn follow(&mut self, seen: &Sighting) {
        if !(seen.command.is_finite() && seen.tip.is_finite()) {
            return;
        }
        if self.anchor.is_none() {
            self.anchor = Some((seen.command, seen.tip));
            self.offsets = seen.offsets;
        } else if self.turned(seen) {
            self.anchor = Some((self.last.command, self.last.tip));
            (self.is_held, self.looks) = (false, 0);
            self.offsets = seen.offsets;
            self.turns = self.turns.saturating_add(1);
        }
        let moved = seen.command - self.last.command;
        if moved.abs() < REST * self.settings.distance {
            self.anchor = Some((seen.command, seen.tip));
            (self.is_held, self.looks) = (false, 0);
            self.offsets = seen.offsets;
        }
        self.last = Last {
            command: seen.command,
            tip: seen.tip,
            travel: seen.travel,
            direction: if moved == 0.0 {
                self.last.direction
            } else {
                moved.signum()
            },
        };
        if self.is_off(seen) {
            self.anchor = Some((seen.command, seen.tip));
            (self.is_held, self.looks) = (false, 0);
        }
        self.look(seen);
        let start = self.anchor.map_or(f64::NAN, |(command, _)| command);
        let is_far = (seen.command - start).abs() >= self.settings.distance;
        if is_far && self.looks == LOOKS && !self.is_held {
            self.anchor = Some(self.lately);
            self.is_held = true;
        }
    }

    fn look(&mut self, seen: &Sighting) {
        self.looks = (self.looks + 1).min(LOOKS);
        let (command, tip) = &mut self.lately;
        let share = 1.0 / f64::from(self.looks);
        *command += share * (seen.command - *command);
        *tip += share * (seen.tip - *tip);
    }

    /// What was held may be so no longer.
    pub const fn release(&mut self) {
        self.anchor = None;
        (self.is_held, self.looks) = (false, 0);
        self.offsets = ANY;
        self.turns = 0;
    }

    /// Whether the command has gone back since the last image that was believed.
    fn turned(&self, seen: &Sighting) -> bool {
        let moved = seen.command - self.last.command;
        let back = seen.travel - self.last.travel - moved.abs();
        moved * self.last.direction < 0.0 || back > TURN * self.settings.slip
    }

    fn is_off(&self, seen: &Sighting) -> bool {
        self.anchor.is_some_and(|(command, tip)| {
            let travel = seen.command - command;
            let off = (seen.tip - tip) - travel;
            off.abs() > self.settings.slip + SLIP_SHARE * travel.abs() + seen.deviation
        })
    }
}
