"""Result of one measurement of a goal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Measurement:
    """Result of one measurement of a goal.

    Attributes:
        text: Result in words.
        runs: Number of runs, steps or cases.
        failures: How many of them missed the goal.
        seeds: Seeds of the runs.
    """

    text: str
    runs: str
    failures: int
    seeds: str = ""

    @classmethod
    def of_times(cls, times: Iterable[float], limit: float, seeds: str) -> Measurement:
        """Return the measurement of times [s] with an upper limit."""
        times = list(times)
        late = sum(each > limit + 1e-9 for each in times)
        return cls(f"{max(times):.3f} s at most", str(len(times)), late, seeds)

    def join(self, other: Measurement) -> Measurement:
        """Return both results in one row."""
        text, runs = f"{self.text}; {other.text}", f"{self.runs}; {other.runs}"
        return replace(self, text=text, runs=runs, failures=self.failures + other.failures)
