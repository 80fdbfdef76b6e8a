//! Flags: what the monitors detect, or the rig reports.

macro_rules! flags {
    ($($(#[doc = $doc:literal])+ $flag:ident = $name:literal,)+) => {
        /// A condition that a monitor detected, or that the rig reported.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Flag { $($(#[doc = $doc])+ $flag,)+ }

        impl Flag {
            /// Every flag, in the order of its bit in [`Flags`].
            pub const ALL: &[Self] = &[$(Self::$flag,)+];

            #[cfg(feature = "serde")]
            const NAMES: &[&str] = &[$($name,)+];

            /// The name in configuration, reports and logs.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$flag => $name,)+ }
            }

            /// The meaning in one sentence.
            pub const fn meaning(self) -> &'static str {
                match self { $(Self::$flag => concat!($($doc),+).trim_ascii(),)+ }
            }

            /// The flag with the given name.
            pub fn from_name(name: &str) -> Option<Self> {
                match name {
                    $($name => Some(Self::$flag),)+
                    _ => None,
                }
            }
        }
    };
}

flags! {
    /// An image or measurement repeats an earlier one although the command has moved.
    Frozen = "frozen",
    /// An image or measurement was older than `frame_age` when it arrived.
    Late = "late",
    /// An image or measurement was made no later than the one before it.
    Duplicate = "duplicate",
    /// No image or measurement has arrived for longer than `frame_gap`.
    Dropped = "dropped",
    /// A time is later than the control tick, goes back, or is not a number.
    Clock = "clock",
    /// The measured state is too far from the predicted state.
    Innovation = "innovation",
    /// The image agrees with the prediction if its two markers are exchanged.
    Swapped = "swapped",
    /// Part of a measurement is missing or impossible: one of two markers, or values of a sensor.
    Merged = "merged",
    /// Nothing was measured that agrees with the prediction: no marker, or no value of a sensor.
    Lost = "lost",
    /// A degree of freedom has moved without a measurement that determines it.
    Unobservable = "unobservable",
    /// The rig reports that a drive does not follow its command.
    FollowingError = "following_error",
    /// The reference jumped: it changed by more than its speed before and `reference_speed` or `dof.speed` allow.
    ReferenceJump = "reference_jump",
    /// The reference was faster than `reference_speed` or `dof.speed` over `reference_time`, and is followed at this speed.
    ReferenceFast = "reference_fast",
    /// The reference was older than `reference_age`, or jumped after its device had been silent for as long.
    ReferenceLate = "reference_late",
    /// The reference is not a finite number.
    ReferenceInvalid = "reference_invalid",
    /// A control tick came too late.
    LateTick = "late_tick",
    /// The rig reports a fault of a drive or of its bus.
    DriveFault = "drive_fault",
    /// The tip moves against its command.
    StartCheck = "start_check",
    /// The estimated slack or the lead of the command reached `width_limit` or `offset_limit`.
    WidthLimit = "width_limit",
    /// A limit of travel, speed or actuators changed a command, or the software is wrong.
    Monitor = "monitor",
    /// A command would have moved faster than `command_speed`.
    CommandJump = "command_jump",
    /// The reference without its slow part reverses more than `tremor_rate` times a second within the slack.
    Tremor = "tremor",
    /// The tip has moved farther than the reference since the reference turned.
    Overcompensation = "overcompensation",
    /// Reference and tip oscillate with growing amplitude.
    LimitCycle = "limit_cycle",
    /// The tip is measured elsewhere than predicted: the slack has changed, the instrument was pushed, or measurements or commands are wrong.
    SlackChanged = "slack_changed",
    /// The images contradict the configured camera: they are shifted by more than three `image_deviation`. Or a sensor contradicts its
    /// model, by three times as much as its covariance says.
    GeometryOff = "geometry_off",
    /// Images or measurements come at another rate than before, or from one sensor less: a clock or a sensor is not as before.
    FrameRate = "frame_rate",
}

/// A set of flags.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flags(u32);

impl Flags {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// Faults of one sensor, which others may make up for.
    pub(crate) const OF_A_SENSOR: Self = Self::of(Flag::Frozen)
        .union(Self::of(Flag::Late))
        .union(Self::of(Flag::Duplicate))
        .union(Self::of(Flag::Clock))
        .union(Self::of(Flag::Innovation))
        .union(Self::of(Flag::Lost));

    /// The set of one flag.
    pub const fn of(flag: Flag) -> Self {
        Self(1 << flag as u32)
    }

    /// The set of one flag if a condition holds, else the empty set.
    pub(crate) const fn when(condition: bool, flag: Flag) -> Self {
        if condition {
            Self::of(flag)
        } else {
            Self::NONE
        }
    }

    /// The flags that are in either set.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The flags of this set that are not in the other.
    #[must_use]
    pub(crate) const fn difference(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether the set contains a flag.
    pub const fn contains(self, flag: Flag) -> bool {
        self.0 & (1 << flag as u32) != 0
    }

    /// Whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The flags of the set, in the order of [`Flag::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Flag> {
        Flag::ALL
            .iter()
            .copied()
            .filter(move |flag| self.contains(*flag))
    }
}

#[cfg(feature = "serde")]
mod deserialize {
    use super::{Flag, Flags};
    use core::fmt;
    use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};

    struct Name;

    impl Visitor<'_> for Name {
        type Value = Flag;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            formatter.write_str("the name of a flag")
        }

        fn visit_str<E: Error>(self, name: &str) -> Result<Flag, E> {
            Flag::from_name(name).ok_or_else(|| E::unknown_variant(name, Flag::NAMES))
        }
    }

    impl<'de> Deserialize<'de> for Flag {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            deserializer.deserialize_str(Name)
        }
    }

    struct Names;

    impl<'de> Visitor<'de> for Names {
        type Value = Flags;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            formatter.write_str("a sequence of names of flags")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut names: A) -> Result<Flags, A::Error> {
            let mut flags = Flags::NONE;
            while let Some(flag) = names.next_element()? {
                flags = flags.union(Flags::of(flag));
            }
            Ok(flags)
        }
    }

    impl<'de> Deserialize<'de> for Flags {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            deserializer.deserialize_seq(Names)
        }
    }
}
