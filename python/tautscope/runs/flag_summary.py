"""Summary of the flags raised in a run, as sentences: meaning, how often and long, reaction."""

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
    ticks: int = 0
    reaction: Reaction = Reaction.NONE


class FlagSummary:
    """Counts updates and ticks with each flag in force, and keeps the strongest reaction."""

    def __init__(self, config: Config) -> None:
        self._period, self._now = config.control.period, list[str]()
        self._updates, self._what = 0, "measurements" if config.dof else "images"
        self._counts: dict[str, _Count] = {}
        self._limited: dict[str, None] = {}

    def add(self, elapsed: float, flags: Sequence[str], reaction: Reaction) -> None:
        """Add an update at a time [s since the start]: `Report.warnings`, and the reaction."""
        self._updates += 1
        for count in self._in_force(elapsed, flags, reaction):
            count.updates += 1
        self._limited |= {name: None for name in flags if name.endswith(LIMITED)}

    def add_tick(self, elapsed: float, flags: Sequence[str], reaction: Reaction) -> None:
        """Add a control tick at a time [s since the start]: flags and reaction after it."""
        for count in self._in_force(elapsed, flags, reaction):
            count.ticks += 1

    def _in_force(self, elapsed: float, flags: Sequence[str], reaction: Reaction) -> list[_Count]:
        self._now = [name for name in flags if name in MEANINGS]
        counts = [self._counts.setdefault(name, _Count(elapsed)) for name in self._now]
        for count in counts:
            count.reaction = max(count.reaction, reaction, key=lambda each: each.rank)
        return counts

    def lines(self, latched: Sequence[str] | None = None) -> tuple[str, ...]:
        """A line for each latched flag, by default for each that was in force.

        One that was in force at no update and after no tick was raised and cleared within one.
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
            return f"{flag} for less than a control period{remedy}"
        end = ", also at its end" if name in self._now else ""
        return (
            f"{flag} at {count.updates} of {self._updates} {self._what}, first {count.first:.1f} s "
            f"into the run, for {self._period * count.ticks:.1f} s in all{end}; "
            f"{_CONSEQUENCES[count.reaction]}{remedy}"
        )
