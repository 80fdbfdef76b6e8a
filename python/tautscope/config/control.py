"""Configuration of the control loop's timing."""

from __future__ import annotations

from tautscope.config.fields import Positive
from tautscope.config.section import Section


class ControlConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Period and history of the control loop."""

    period: Positive = 0.005
    """Control period [s] [ours; the article states hundreds of Hz]."""
    history: Positive = 2.0
    """Length of the command history, at most 1024 ticks [s]. Older frames are rejected."""
