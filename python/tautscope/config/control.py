"""The loop's clock."""

from __future__ import annotations

from msgspec import Struct

from tautscope.config.fields import Positive


class ControlConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Rates and memory of the loop."""

    period: Positive = 0.005
    """Control tick [s] [ours; the article says hundreds of Hz]."""
    history: Positive = 2.0
    """How long commands are remembered, so that a frame finds the one in force when it was
    captured [s]; at most 1024 ticks. An older frame is refused."""
