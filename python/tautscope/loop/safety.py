"""Flags, reactions and state of the supervisor."""

import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tautscope import _core
from tautscope.config import Config

DETECTORS: tuple[str, ...] = _core.DETECTORS
"""Names of all flags; `safety.off` may name any of them."""

MEANINGS: dict[str, str] = dict(zip(DETECTORS, _core.MEANINGS, strict=True))
"""The meaning of each flag, in one sentence."""

REMEDIES: dict[str, str] = {
    "drive_fault": "find the cause at the drives, then enable again",
    "following_error": "free the instrument, then enable again",
    "command_jump": "use profile best with an input device slower than the loop; else keep the"
    " log: the software is wrong",
    "monitor": "move back from the end of the travel",
    "reference_invalid": "check the input device, then re-engage",
    "reference_jump": "let go of the input device, then re-engage",
    "reference_late": "check the connection of the input device, then re-engage",
    "late_tick": "close other programs on this computer, and after a pause re-engage",
    "start_check": "check the signs of motors and sensors, then re-engage",
    "limit_cycle": "move more slowly",
    "dropped": "check the camera or sensor; a slow one needs a larger safety.frame_gap",
    "frozen": "check the camera or sensor",
    "clock": "check the clock of the camera or sensor",
    "late": "check the load of this computer and the delay of the camera or sensor",
    "duplicate": "check the driver of the camera or sensor",
    "frame_rate": "check the clock and the rate of camera and sensors",
    "swapped": "look in the image which band is which",
    "lost": "bring the bands into the image, or check the sensor",
    "innovation": "look at the image, or check scale and zero of the sensor, and rest for a moment",
    "merged": "bring both bands into the image, or check the sensor",
    "unobservable": "bend the section a little, or check the sensor",
    "overcompensation": "move slowly until the slack is learned",
    "slack_changed": "move slowly until the slack is learned",
    "tremor": "scale the motion down",
    "reference_fast": "move more slowly",
    "geometry_off": "run tautscope calibrate geometry, for a sensor tautscope calibrate robot, or"
    " give its deviation in [measurement]",
    "width_limit": "raise width_limit if there is more slack, or check zero and scale of the"
    " sensor",
}
"""What to do about each flag, as a phrase that begins with a verb; the most urgent first."""

_ROW_STEP = 8


def by_urgency(flags: Iterable[str]) -> list[str]:
    """Flags, the most urgent first."""
    return sorted(flags, key=list(REMEDIES).index)


def advice(flag: str) -> str:
    """The meaning of a flag and what to do, in two sentences."""
    remedy = REMEDIES[flag]
    return f"{MEANINGS[flag]} {remedy[0].upper()}{remedy[1:]}."


class Reaction(StrEnum):
    """What the loop does while a flag is active, R0 to R7; a later one has priority."""

    NONE = "none"
    """Continue."""
    WARN = "warn"
    """Continue, with a warning until it is acknowledged."""
    HOLD_ESTIMATE = "hold_estimate"
    """Compensate with the slack estimated so far; images update nothing."""
    FADE = "fade"
    """As `HOLD_ESTIMATE`, and reduce the compensation to nothing with motion."""
    PASS_THROUGH = "pass_through"
    """Do not compensate: move the command as the reference does. Profile ``best`` gives back the
    difference with motion."""
    HOLD_MOTION = "hold_motion"
    """Hold the command; motion of the reference is discarded."""
    QUICK_STOP = "quick_stop"
    """As `HOLD_MOTION`, and the rig brings its drives to quick stop."""
    DISABLE = "disable"
    """As `HOLD_MOTION`, and the rig disables its drives."""

    @property
    def rank(self) -> int:
        """0 to 7."""
        return _RANKS[self]


_RANKS = {reaction: rank for rank, reaction in enumerate(Reaction)}
_EFFECTS = {
    Reaction.HOLD_ESTIMATE: "The slack is held as estimated so far",
    Reaction.FADE: "Compensation fades out with motion",
    Reaction.PASS_THROUGH: "No compensation; the command follows the reference",
    Reaction.HOLD_MOTION: "Motion is held",
    Reaction.QUICK_STOP: "Quick stop",
    Reaction.DISABLE: "The motors are disabled",
}


@dataclass(frozen=True, slots=True)
class Supervision:
    """State of the supervisor.

    Attributes:
        flags: The active flags, by the names of `DETECTORS`.
        latched: The flags raised since the last acknowledgement.
        lead: Share that the supervisor allows of the chosen compensation
            (`HysteresisReduction.set_compensation`), 0 to 1.
    """

    reaction: Reaction
    flags: tuple[str, ...]
    latched: tuple[str, ...]
    lead: float

    @property
    def effect(self) -> str:
        """What the reaction does, why, and what to do; empty where the loop does all it can."""
        effect = _EFFECTS.get(self.reaction)
        return f"{effect}: {advice(by_urgency(self.flags)[0])}" if effect else ""


def disabled_monitors(config: Config) -> tuple[str, ...]:
    """A line for each entry of ``safety.off`` and ``safety.unusual``; in logs word by word."""
    off = (f"safety.off = {name}: nobody looks for it" for name in config.safety.off)
    unusual = (f"safety.unusual: {key} may be beyond its range" for key in config.safety.unusual)
    return (*off, *unusual)


def checksum(image: NDArray[np.uint8]) -> int:
    """Checksum of every eighth row; images with sensor noise have different ones."""
    return zlib.crc32(image[::_ROW_STEP].tobytes())
