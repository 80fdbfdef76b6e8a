"""Flags, reactions and state of the supervisor."""

from __future__ import annotations

import zlib
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

REMEDIES: dict[str, str] = {"geometry_off": "tautscope calibrate geometry finds the geometry"}
"""What to do about a flag, where a command helps."""

_ROW_STEP = 8


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
    """Move the command as the reference does, at a constant difference."""
    HOLD_MOTION = "hold_motion"
    """Hold the command; motion of the reference is discarded."""
    QUICK_STOP = "quick_stop"
    """As `HOLD_MOTION`, and the rig brings its drives to quick stop."""
    DISABLE = "disable"
    """As `HOLD_MOTION`, and the rig disables its drives."""

    @property
    def rank(self) -> int:
        """0 to 7."""
        return list(Reaction).index(self)


@dataclass(frozen=True, slots=True)
class Supervision:
    """State of the supervisor.

    Attributes:
        reaction: The reaction in force.
        flags: The active flags, by the names of `DETECTORS`.
        latched: The flags raised since the last acknowledgement.
        lead: Share of the free gain in use, 0 to 1.
    """

    reaction: Reaction
    flags: tuple[str, ...]
    latched: tuple[str, ...]
    lead: float


def disabled_monitors(config: Config) -> tuple[str, ...]:
    """A line for each entry of ``safety.off`` and ``safety.unusual``; in logs word by word."""
    off = (f"safety.off = {name}: nobody looks for it" for name in config.safety.off)
    unusual = (f"safety.unusual: {key} may be beyond its range" for key in config.safety.unusual)
    return (*off, *unusual)


def checksum(image: NDArray[np.uint8]) -> int:
    """Checksum of every eighth row; images with sensor noise have different ones."""
    return zlib.crc32(image[::_ROW_STEP].tobytes())
