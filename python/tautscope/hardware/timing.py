"""How punctual a run was: every cycle of set-points, the age of every frame."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CYCLE_COLUMNS = ("due", "began", "ended", "new")
FRAME_COLUMNS = ("captured", "arrived", "used")


@dataclass
class Timing:
    """Grows while a run goes on, about 9 MB per hour; instants are of the monotonic clock [s].

    A cycle without a new set-point is lost: the loop was late and the last one was *held*, or the
    thread itself woke too late and it was *skipped*. Neither is made up for.

    Attributes:
        cycle: Time from one set-point to the next as it should be [s].
        realtime: Why there is no real-time priority; empty if there is.
    """

    cycle: float
    realtime: str = ""
    _cycles: array[float] = field(default_factory=lambda: array("d"))
    _frames: array[float] = field(default_factory=lambda: array("d"))

    def add_cycle(self, due: float, began: float, ended: float, is_new: bool) -> None:
        """A set-point was due, was sent, and answered; `is_new`: it was not the last one again."""
        self._cycles.extend((due, began, ended, is_new))

    def add_frame(self, captured_at: float, arrived_at: float, used_at: float) -> None:
        """A frame was captured, decoded, and given to the loop."""
        self._frames.extend((captured_at, arrived_at, used_at))

    @property
    def cycles(self) -> Floats:
        """(n, 4) due, began, ended [s], and 1 for a new set-point, 0 for one that was held.

        Up to the last new one: what is held when the run is over is not late.
        """
        cycles: Floats = np.array(self._cycles[:]).reshape(-1, 4)
        return cycles[: np.flatnonzero(cycles[:, 3])[-1] + 1] if cycles[:, 3].any() else cycles[:0]

    @property
    def frames(self) -> Floats:
        """(n, 3) captured, arrived, given to the loop [s]."""
        return np.array(self._frames[:]).reshape(-1, 3)

    @property
    def sent(self) -> Floats:
        """(ticks,) when the set-point of each control tick was sent [s]."""
        cycles = self.cycles
        sent: Floats = cycles[cycles[:, 3] == 1, 1]
        return sent

    @property
    def jitter(self) -> Floats:
        """(n,) how much later than due each set-point was sent [s]."""
        cycles = self.cycles
        return cycles[:, 1] - cycles[:, 0]

    @property
    def frame_age(self) -> Floats:
        """(n,) from capture until the loop was given the frame [s]."""
        frames = self.frames
        return frames[:, 2] - frames[:, 0]

    @property
    def held(self) -> int:
        """Cycles in which the loop had no new command, and the last one was sent again."""
        return int((self.cycles[:, 3] == 0).sum())

    @property
    def skipped(self) -> int:
        """Cycles for which the thread woke too late, and which were left out."""
        due = self.cycles[:, 0]
        return int((np.round(np.diff(due) / self.cycle) - 1).sum())

    @property
    def lost(self) -> int:
        """Cycles without a new set-point."""
        return self.held + self.skipped

    def write(self, folder: Path, suffix: str = "") -> None:
        """Write timing_cycles.csv and timing_frames.csv; `suffix` goes on their names."""
        for name, table, columns in (
            ("cycles", self.cycles, CYCLE_COLUMNS),
            ("frames", self.frames, FRAME_COLUMNS),
        ):
            file = folder / f"timing_{name}{suffix}.csv"
            np.savetxt(file, table, "%.6f", ",", header=",".join(columns), comments="")

    def summary(self) -> dict[str, Any]:
        """For JSON; times in ms."""
        cycles, frames = self.cycles, self.frames
        return {
            "cycle_ms": 1e3 * self.cycle,
            "cycles": len(cycles) + self.skipped,
            "lost_cycles": self.lost,
            "held_cycles": self.held,
            "skipped_cycles": self.skipped,
            "realtime": not self.realtime,
            "jitter_ms": _spread(self.jitter),
            "answer_ms": _spread(cycles[:, 2] - cycles[:, 1]),
            "frames": len(frames),
            "frame_age_ms": _spread(self.frame_age),
            "frame_waiting_ms": _spread(frames[:, 2] - frames[:, 1]),
        }


def read_sent(path: Path) -> Floats:
    """(ticks,) `Timing.sent` of a file of cycles [s]."""
    cycles = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    sent: Floats = cycles[cycles[:, 3] == 1, 1]
    return sent


def _spread(times: Floats) -> dict[str, float | None]:
    if not len(times):
        return {"median": None, "p99": None, "worst": None}
    median, p99, worst = 1e3 * np.percentile(times, [50, 99, 100])
    return {"median": float(median), "p99": float(p99), "worst": float(worst)}
