"""Summary of the flags raised in a run, as sentences: meaning, number of updates, reaction."""

from collections.abc import Sequence
from dataclasses import dataclass

from tautscope.config import Config
from tautscope.loop.reduction import LIMITED
from tautscope.loop.safety import MEANINGS, REMEDIES, Reaction

_CONSEQUENCES = {
    Reaction.NONE: "the loop continued",
    Reaction.WARN: "the loop continued",
    Reaction.HOLD_ESTIMATE: "the estimates were held meanwhile",
    Reaction.FADE: "the compensation faded out meanwhile",
    Reaction.PASS_THROUGH: "the command moved with the reference, uncompensated, meanwhile",
    Reaction.HOLD_MOTION: "motion was held",
    Reaction.QUICK_STOP: "the motors were stopped",
    Reaction.DISABLE: "the motors were disabled",
}
_AFTERWARDS = ("geometry_off", "width_limit")
"""Flags whose remedy helps after the run."""


@dataclass
class _Count:
    first: float
    updates: int = 0
    reaction: Reaction = Reaction.NONE


class FlagSummary:
    """Counts the updates at which each flag was in force, and keeps the strongest reaction."""

    def __init__(self, config: Config) -> None:
        self._updates, self._what = 0, "measurements" if config.dof else "images"
        self._counts: dict[str, _Count] = {}
        self._limited: dict[str, None] = {}

    def add(self, elapsed: float, flags: Sequence[str], reaction: Reaction) -> None:
        """Add an update at a time [s since the start]: `Report.warnings`, and the reaction."""
        self._updates += 1
        for name in flags:
            if name in MEANINGS:
                count = self._counts.setdefault(name, _Count(elapsed))
                count.updates += 1
                count.reaction = max(count.reaction, reaction, key=lambda each: each.rank)
            elif name.endswith(LIMITED):
                self._limited[name] = None

    def lines(self, latched: Sequence[str] | None = None) -> tuple[str, ...]:
        """A line for each latched flag, by default for each that was in force at an update.

        One that was in force at none was raised and cleared between two.
        """
        return tuple(self._line(name) for name in (self._counts if latched is None else latched))

    def _line(self, name: str) -> str:
        meaning = MEANINGS[name].rstrip(".").replace("`", "")
        flag = f"{name} ({meaning[0].lower()}{meaning[1:]})"
        remedy = f"; {REMEDIES[name]}" if name in _AFTERWARDS else ""
        if name == "monitor" and self._limited:
            remedy = f"; {', '.join(self._limited)}"
        count = self._counts.get(name)
        if count is None:
            return f"{flag} between two {self._what}{remedy}"
        return (
            f"{flag} at {count.updates} of {self._updates} {self._what}, first {count.first:.1f} s "
            f"into the run; {_CONSEQUENCES[count.reaction]}{remedy}"
        )
