"""What the surgeon asks for: reference trajectories, and which DOF moves when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tautscope.config import ExperimentConfig
from tautscope.dof import Dof


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of a reference in which one DOF repeats a motion.

    Attributes:
        dof: Which one moves.
        start: When it begins [s from the start of the reference].
        period: Of the motion [s].
        periods: How many there are.
    """

    dof: Dof
    start: float
    period: float
    periods: int

    @property
    def end(self) -> float:
        """When it ends [s from the start of the reference]."""
        return self.start + self.period * self.periods


class Reference(Protocol):
    """A desired motion of the tip."""

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        ...

    @property
    def segments(self) -> Sequence[Segment]:
        """Which DOF moves when; may be empty."""
        ...

    def __call__(self, time: float) -> NDArray[np.float64]:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        ...


@runtime_checkable
class DatedReference(Reference, Protocol):
    """A reference that comes from elsewhere, a hand for one, and may be late or stay away.

    One that is made when it is asked for needs no date.
    """

    @property
    def made_at(self) -> float:
        """When what was returned last was made [s from the start of the reference]."""
        ...


class SineSequence:
    """The article's protocol (Section 5): a sine on each DOF in succession.

    Insertion, rotation, bending, in this order: centre + amplitude sin(2 pi t / period) for the
    moving DOF with t from the start of its segment, the centre for the others. The position has
    no jump; before the start and after the end every DOF is at its centre.

    Args:
        experiment: Centre, amplitude and period per DOF; number of periods.
    """

    def __init__(self, experiment: ExperimentConfig) -> None:
        self._sines = [experiment[dof] for dof in Dof]
        self._centre = np.array([sine.centre for sine in self._sines])
        segments: list[Segment] = []
        start = 0.0
        for dof, sine in zip(Dof, self._sines, strict=True):
            segments.append(Segment(dof, start, sine.period, experiment.periods))
            start = segments[-1].end
        self.segments: tuple[Segment, ...] = tuple(segments)
        self.duration: float = start

    def __call__(self, time: float) -> NDArray[np.float64]:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        position = self._centre.copy()
        for segment, sine in zip(self.segments, self._sines, strict=True):
            if segment.start <= time < segment.end:
                phase = 2 * np.pi * (time - segment.start) / sine.period
                position[segment.dof] += sine.amplitude * np.sin(phase)
        return position
