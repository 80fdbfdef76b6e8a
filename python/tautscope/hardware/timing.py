"""Timing of a run: set-point cycles and frame ages."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass
class Timing:
    """Records set-point cycles and frames, about 9 MB per hour; times on the monotonic clock [s].

    A cycle without a new set-point is lost: *held* if the loop was late and the last set-point was
    repeated, *skipped* if the set-point thread woke too late.

    Attributes:
        cycle: Nominal time from one set-point to the next [s].
        realtime: Why there is no real-time priority; empty if there is.
    """

    cycle: float
    realtime: str = ""
    _cycles: array[float] = field(default_factory=lambda: array("d"))
    _frames: array[float] = field(default_factory=lambda: array("d"))

    def add_cycle(self, due: float, began: float, ended: float, is_new: bool) -> None:
        """Record when a set-point was due, sent and answered; `is_new` unless it was repeated."""
        self._cycles.extend((due, began, ended, is_new))

    def add_frame(self, captured_at: float, arrived_at: float, used_at: float) -> None:
        """Record when a frame was captured, decoded, and given to the loop."""
        self._frames.extend((captured_at, arrived_at, used_at))

    @property
    def cycles(self) -> Floats:
        """(n, 4) due, began, ended [s], and 1 for a new set-point, 0 for a held one.

        Ends with the last new set-point: cycles held after the run are not lost.
        """
        cycles: Floats = np.array(self._cycles[:]).reshape(-1, 4)
        return cycles[: np.flatnonzero(cycles[:, 3])[-1] + 1] if cycles[:, 3].any() else cycles[:0]

    @property
    def frames(self) -> Floats:
        """(n, 3) captured, arrived, given to the loop [s]."""
        return np.array(self._frames[:]).reshape(-1, 3)

    @property
    def sent(self) -> Floats:
        """(ticks,) time at which the set-point of each control tick was sent [s]."""
        cycles = self.cycles
        sent: Floats = cycles[cycles[:, 3] == 1, 1]
        return sent

    @property
    def jitter(self) -> Floats:
        """(n,) delay of each set-point after its due time [s]."""
        cycles = self.cycles
        return cycles[:, 1] - cycles[:, 0]

    @property
    def frame_age(self) -> Floats:
        """(n,) time from capture until the loop took the frame [s]."""
        frames = self.frames
        return frames[:, 2] - frames[:, 0]

    @property
    def held(self) -> int:
        """Number of cycles in which the last set-point was repeated."""
        return int((self.cycles[:, 3] == 0).sum())

    @property
    def skipped(self) -> int:
        """Number of cycles for which the set-point thread woke too late."""
        due = self.cycles[:, 0]
        return int((np.round(np.diff(due) / self.cycle) - 1).sum())

    @property
    def lost(self) -> int:
        """Number of cycles without a new set-point."""
        return self.held + self.skipped

    def write(self, folder: Path, suffix: str = "") -> None:
        """Write timing_cycles.csv and timing_frames.csv; `suffix` is appended to their names."""
        for name, table, header in (
            ("cycles", self.cycles, "due,began,ended,new"),
            ("frames", self.frames, "captured,arrived,used"),
        ):
            file = folder / f"timing_{name}{suffix}.csv"
            np.savetxt(file, table, "%.6f", ",", header=header, comments="")

    def summary(self) -> dict[str, Any]:
        """Statistics for JSON; times in ms."""
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
    """Read `Timing.sent` (ticks,) [s] from a timing_cycles.csv."""
    cycles = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    sent: Floats = cycles[cycles[:, 3] == 1, 1]
    return sent


def _spread(times: Floats) -> dict[str, float | None]:
    if not len(times):
        return {"median": None, "p99": None, "worst": None}
    median, p99, worst = 1e3 * np.percentile(times, [50, 99, 100])
    return {"median": float(median), "p99": float(p99), "worst": float(worst)}
