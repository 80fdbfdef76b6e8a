"""What is watched in the loop, and what is done about it."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tautscope import _core
from tautscope.config import Config

DETECTORS: tuple[str, ...] = _core.DETECTORS
"""Names of all flags, from crates/core/src/supervision/flags.rs; `safety.off` may name any."""

MEANINGS: dict[str, str] = dict(zip(DETECTORS, _core.MEANINGS, strict=True))
"""What each of them says, in a sentence."""

_ROWS_BETWEEN = 8


class Reaction(StrEnum):
    """What the loop does about a flag, R0 to R7; a later one wins over an earlier one."""

    NONE = "none"
    """Goes on."""
    WARN = "warn"
    """Goes on, and says so until it is acknowledged."""
    HOLD_ESTIMATE = "hold_estimate"
    """Compensates with the slack known; images teach nothing."""
    FADE = "fade"
    """The same, and gives the compensation up with motion."""
    PASS_THROUGH = "pass_through"
    """Increments of the command are those of the reference; what the command leads by stays."""
    HOLD_MOTION = "hold_motion"
    """The command rests; motion of the reference is thrown away."""
    QUICK_STOP = "quick_stop"
    """The same, and the rig brings its drives to quick stop."""
    DISABLE = "disable"
    """The same, and the rig disables its drives."""

    @property
    def rank(self) -> int:
        """0 to 7."""
        return list(Reaction).index(self)


@dataclass(frozen=True, slots=True)
class Supervision:
    """How the loop stands.

    Attributes:
        reaction: What is in force.
        flags: Why, by the names of `DETECTORS`.
        latched: What has been wrong since the last acknowledgement.
        lead: Share of the free gain in use, 0 to 1.
    """

    reaction: Reaction
    flags: tuple[str, ...]
    latched: tuple[str, ...]
    lead: float


def switched_off(config: Config) -> tuple[str, ...]:
    """A line for every guard that does not look."""
    return tuple(f"safety.off = {name}: nobody looks for it" for name in config.safety.off)


def checksum(image: NDArray[np.uint8]) -> int:
    """Of every eighth row: a picture with sensor noise in it never has that of another."""
    return zlib.crc32(image[::_ROWS_BETWEEN].tobytes())
