//! What can be noticed to be wrong. The one place where it has a name.

macro_rules! flags {
    ($($(#[doc = $doc:literal])+ $flag:ident = $name:literal,)+) => {
        /// What a guard noticed, or the rig reported.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Flag { $($(#[doc = $doc])+ $flag,)+ }

        impl Flag {
            /// Every flag, in the order of its bit in [`Flags`].
            pub const ALL: &[Self] = &[$(Self::$flag,)+];

            /// As configuration, reports and logs call it.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$flag => $name,)+ }
            }

            /// What it says, in a sentence.
            pub const fn meaning(self) -> &'static str {
                match self { $(Self::$flag => concat!($($doc),+).trim_ascii(),)+ }
            }

            /// The flag of that name.
            pub fn named(name: &str) -> Option<Self> {
                match name {
                    $($name => Some(Self::$flag),)+
                    _ => None,
                }
            }
        }
    };
}

flags! {
    /// The picture is the same to the last bit although the command moved.
    Frozen = "frozen",
    /// A frame older than `frame_age` when it came.
    Late = "late",
    /// A frame that was captured no later than the one before.
    Duplicate = "duplicate",
    /// No frame for longer than `frame_gap`.
    Dropped = "dropped",
    /// A time that is ahead of the control tick, goes back, or is no number.
    Clock = "clock",
    /// An image too far from what model and last images make one expect.
    Innovation = "innovation",
    /// An image in which the tip went farther than its command.
    Jump = "jump",
    /// An image in which a tip in contact does not go with its command.
    Slip = "slip",
    /// An image that would be as expected with the markers exchanged.
    Swapped = "swapped",
    /// One marker alone, or two of which one is where it cannot be.
    Merged = "merged",
    /// No marker, or none that could be believed.
    Lost = "lost",
    /// Both markers, and yet a DOF that they do not determine.
    Unobservable = "unobservable",
    /// A drive is not where it was told to be; the rig says so.
    FollowingError = "following_error",
    /// A reference that gained more in `reference_time` than `reference_speed` allows, or all at once.
    ReferenceJump = "reference_jump",
    /// A reference older than `reference_age`, or one that moves on as no hand does after it was silent for so long.
    ReferenceLate = "reference_late",
    /// A reference that is no number.
    ReferenceInvalid = "reference_invalid",
    /// A control tick that came too late.
    LateTick = "late_tick",
    /// A drive or its bus failed; the rig says so.
    DriveFault = "drive_fault",
    /// The tip does not go where the command goes, by sign or by scale; the rig says so.
    StartCheck = "start_check",
    /// More slack was learnt than there can be.
    WidthLimit = "width_limit",
    /// The monitor changed a command.
    Monitor = "monitor",
    /// A command that would have changed faster than `command_speed`.
    CommandJump = "command_jump",
    /// A hand that trembles: `tremor_rate` reversals in a second, each within the slack.
    Tremor = "tremor",
    /// A tip that came farther than its reference since the reference turned.
    Overcompensation = "overcompensation",
    /// Reference and tip that swing farther each time, one after the other.
    LimitCycle = "limit_cycle",
    /// Images that say another slack than was learnt: the instrument has changed, or they are wrong.
    SlackChanged = "slack_changed",
}

/// A set of flags.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flags(u32);

impl Flags {
    /// None of them.
    pub const NONE: Self = Self(0);

    /// One of them.
    pub const fn of(flag: Flag) -> Self {
        Self(1 << flag as u32)
    }

    /// One of them, if it holds.
    pub const fn when(holds: bool, flag: Flag) -> Self {
        if holds { Self::of(flag) } else { Self::NONE }
    }

    /// Those in either.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Those that are not in the other.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether the flag is in it.
    pub const fn has(self, flag: Flag) -> bool {
        self.0 & (1 << flag as u32) != 0
    }

    /// Whether there is none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Each of them, in order.
    pub fn iter(self) -> impl Iterator<Item = Flag> {
        Flag::ALL
            .iter()
            .copied()
            .filter(move |flag| self.has(*flag))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_has_a_bit_and_a_name_of_its_own() {
        let mut seen = Flags::NONE;
        for flag in Flag::ALL {
            assert!(!seen.has(*flag));
            seen = seen.and(Flags::of(*flag));
            assert_eq!(Flag::named(flag.name()), Some(*flag));
        }
        assert!(seen.iter().eq(Flag::ALL.iter().copied()));
        assert!(seen.without(seen).is_empty());
        assert_eq!(Flag::named("nothing"), None);
    }
}
