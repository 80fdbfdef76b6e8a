"""The flags that monitors raise in the loop, and the reactions to them."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tautscope import _core
from tautscope.config import Config

DETECTORS: tuple[str, ...] = _core.DETECTORS
"""Names of all flags, defined in crates/core/src/flags.rs; `safety.off` may name any."""

MEANINGS: dict[str, str] = dict(zip(DETECTORS, _core.MEANINGS, strict=True))
"""The meaning of each flag, in a sentence."""

_ROWS_BETWEEN = 8


class Reaction(StrEnum):
    """Reaction of the loop to a flag, R0 to R7; the later one in this list takes precedence."""

    NONE = "none"
    """The loop continues."""
    WARN = "warn"
    """The loop continues; the warning stays until it is acknowledged."""
    HOLD_ESTIMATE = "hold_estimate"
    """Compensation continues with the current offsets; images update no estimate."""
    FADE = "fade"
    """As `HOLD_ESTIMATE`, and the compensation fades out with motion."""
    PASS_THROUGH = "pass_through"
    """Command increments equal reference increments; the compensation offset is constant."""
    HOLD_MOTION = "hold_motion"
    """The command is constant; motion of the reference is discarded."""
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
        flags: The flags in force, by the names of `DETECTORS`.
        latched: Every flag raised since the last acknowledgement.
        lead: Share of the gap-crossing gain in use, 0 to 1.
    """

    reaction: Reaction
    flags: tuple[str, ...]
    latched: tuple[str, ...]
    lead: float


def disabled_monitors(config: Config) -> tuple[str, ...]:
    """A line for every monitor that ``safety.off`` disables; logs contain these very words."""
    return tuple(f"safety.off = {name}: nobody looks for it" for name in config.safety.off)


def checksum(image: NDArray[np.uint8]) -> int:
    """Checksum of every eighth row: differs between any two images with sensor noise."""
    return zlib.crc32(image[::_ROWS_BETWEEN].tobytes())
