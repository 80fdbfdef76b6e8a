"""The hand in a run with a fault, and the device between it and the loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from fault_watch import STILL, Watch
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import Segment
from tautscope.twin.faults import FaultyReference

Floats = NDArray[np.float64]


class Hand:
    """What the hand does, on the twin's own clock, until all has been seen; a `Reference`.

    Args:
        config: Centres and amplitudes.
        periods: Of the sine of each DOF that moves [s].
        clock: The twin's own [s].
        end: When the run is over [s].

    Attributes:
        pauses: (start, end) [s] in which the hand means no motion, whatever it does.
        paused: Of which DOFs.
    """

    segments: tuple[Segment, ...] = ()

    def __init__(
        self, config: Config, periods: dict[Dof, float], clock: Callable[[], float], end: float
    ) -> None:
        self.clock, self.end = clock, end
        self.pauses: Sequence[tuple[float, float]] = ()
        self.paused: Sequence[int] = tuple(Dof)
        self._centre = np.array([config.experiment[dof].centre for dof in Dof])
        self._sines = [
            (int(dof), config.experiment[dof].amplitude, 2 * math.pi / period)
            for dof, period in periods.items()
        ]

    @property
    def duration(self) -> float:
        """Infinite, until it is over: the loop's clock may be wrong, the twin's is not."""
        return 0.0 if self.clock() >= self.end - 1e-9 else math.inf

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad]; the argument is what the loop takes for the time."""
        now = self.clock()
        position = self._at(now)
        for start, end in self.pauses:
            if now > start:
                moved = self._at(min(now, end)) - self._at(start)
                position[list(self.paused)] -= moved[list(self.paused)]
        return position

    def _at(self, time: float) -> Floats:
        position = self._centre.copy()
        for dof, amplitude, rate in self._sines:
            position[dof] += amplitude * math.sin(rate * time)
        return position


class AllSeen(Exception):  # noqa: N818
    """The run is over; what the loop recorded of it is not made up, as nobody reads it."""


@dataclass
class Device:
    """Between hand and loop, exchangeable during a run; a `Reference`.

    Attributes:
        hand: What it means.
        watch: Ends the run a while after a stop.
        faulty: What comes of it.
        meant: What the hand meant since it may be faulty (3,) [m, rad, rad].
        told: What came of it.
    """

    hand: Hand
    watch: Watch
    faulty: FaultyReference | None = None
    segments: tuple[Segment, ...] = ()
    duration: float = math.inf
    meant: list[Floats] = field(default_factory=list)
    told: list[Floats] = field(default_factory=list)

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad].

        Raises:
            AllSeen: The hand is done, or was stopped a while ago.
        """
        now = self.hand.clock()
        if now >= min(self.watch.stop + STILL, self.hand.end) - 1e-9:
            raise AllSeen
        meant = self.hand(now)
        if self.faulty is None:
            return meant
        told = self.faulty(now)
        self.meant.append(meant)
        self.told.append(told)
        return told
