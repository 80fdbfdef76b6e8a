"""Operator input of a run with a fault, and the input device that reports it to the loop."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from faults.recorder import RunRecorder
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import Segment
from tautscope.twin.faults import FaultyReference

Floats = NDArray[np.float64]

OBSERVED_STOPPED = 1.0
"""How long the tip is observed after the motion was stopped [s]."""


class OperatorInput:
    """Sines on some DOFs, as a function of the twin's own clock; implements `Reference`.

    Args:
        config: Centres and amplitudes.
        periods: Period of the sine of each DOF that moves [s].
        clock: The twin's own clock [s].
        end: End of the run [s].

    Attributes:
        pauses: (start, end) of intervals without motion [s].
        paused: DOFs that pause.
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
        """Infinite until the end by the twin's clock; the loop's clock may be wrong."""
        return 0.0 if self.clock() >= self.end - 1e-9 else math.inf

    def __call__(self, time: float) -> Floats:
        """Return the intended reference (3,) [m, rad, rad]; the loop's time is not used."""
        now = self.clock()
        position = self._sines_at(now)
        for start, end in self.pauses:
            if now > start:
                skipped = self._sines_at(min(now, end)) - self._sines_at(start)
                position[list(self.paused)] -= skipped[list(self.paused)]
        return position

    def _sines_at(self, time: float) -> Floats:
        position = self._centre.copy()
        for dof, amplitude, rate in self._sines:
            position[dof] += amplitude * math.sin(rate * time)
        return position


class RunFinished(Exception):  # noqa: N818
    """The run is over. No recording of the loop is made, because nothing reads it."""


@dataclass
class InputDevice:
    """Input device between operator and loop; implements `Reference`.

    Attributes:
        operator: Intended motion.
        recorder: Ends the run some time after a stop.
        faulty: The intended motion with a fault, once there is one.
        intended: References intended since then, each (3,) [m, rad, rad].
        reported: References reported to the loop since then, likewise.
    """

    operator: OperatorInput
    recorder: RunRecorder
    faulty: FaultyReference | None = None
    segments: tuple[Segment, ...] = ()
    duration: float = math.inf
    intended: list[Floats] = field(default_factory=list)
    reported: list[Floats] = field(default_factory=list)

    def __call__(self, time: float) -> Floats:
        """Return the reported reference (3,) [m, rad, rad].

        Raises:
            RunFinished: The run is over, or the motion was stopped some time ago.
        """
        now = self.operator.clock()
        if now >= min(self.recorder.stop + OBSERVED_STOPPED, self.operator.end) - 1e-9:
            raise RunFinished
        intended = self.operator(now)
        if self.faulty is None:
            return intended
        reported = self.faulty(now)
        self.intended.append(intended)
        self.reported.append(reported)
        return reported
