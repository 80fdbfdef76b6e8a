"""Timing of the loop."""

from __future__ import annotations

from msgspec import Struct

from tautscope.config.fields import Positive


class ControlConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Control period and command history of the loop."""

    period: Positive = 0.005
    """Control period [s] [ours; the article has hundreds of Hz]."""
    history: Positive = 2.0
    """Length of the command history, which gives the command at the capture time of a frame [s]; at
    most 1024 ticks. An older frame is rejected."""
