"""What the guards noticed in a run, for a person: what, how often, and what was done about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tautscope.loop.reduction import Report
from tautscope.loop.safety import MEANINGS, Reaction

_DONE = {
    Reaction.NONE: "the loop went on",
    Reaction.WARN: "the loop went on",
    Reaction.HOLD_ESTIMATE: "meanwhile nothing was learnt",
    Reaction.FADE: "meanwhile the compensation faded",
    Reaction.PASS_THROUGH: "meanwhile the command moved as the reference did",
    Reaction.HOLD_MOTION: "motion was held",
    Reaction.QUICK_STOP: "the drives were stopped",
    Reaction.DISABLE: "the drives were disabled",
}


@dataclass
class _Count:
    first: float
    images: int = 0
    reaction: Reaction = Reaction.NONE


class Noticed:
    """Counts the images at which each flag was in force, and the strongest reaction then."""

    def __init__(self) -> None:
        self._images = 0
        self._counts: dict[str, _Count] = {}

    def image(self, elapsed: float, report: Report) -> None:
        """An image update, so long after the run began [s]."""
        self._images += 1
        for name in report.warnings:
            if name in MEANINGS:
                count = self._counts.setdefault(name, _Count(elapsed))
                count.images += 1
                count.reaction = max(count.reaction, report.reaction, key=lambda each: each.rank)

    def lines(self, latched: Sequence[str]) -> tuple[str, ...]:
        """A line for each flag of a run, by the names of `tautscope.loop.safety.DETECTORS`.

        One that no image met came and went between two of them.
        """
        return tuple(self._line(name) for name in latched)

    def _line(self, name: str) -> str:
        meaning = MEANINGS[name].rstrip(".").replace("`", "")
        what = f"{name} ({meaning[0].lower()}{meaning[1:]})"
        count = self._counts.get(name)
        if count is None:
            return f"{what} between two images"
        return (
            f"{what} at {count.images} of {self._images} images, first {count.first:.1f} s into "
            f"the run; {_DONE[count.reaction]}"
        )
