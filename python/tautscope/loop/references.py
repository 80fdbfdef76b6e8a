"""Reference trajectories: where the tip should be, and which DOF moves when."""

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
    """A part of a reference in which one DOF repeats a motion.

    Attributes:
        dof: The DOF that moves.
        start: When it begins [s from the start of the reference].
        period: Period of the motion [s].
        periods: Number of periods.
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
        """Duration [s]."""
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
    """A reference from an input device, which may arrive late or not at all, with its time.

    A reference computed when it is called needs none.
    """

    @property
    def made_at(self) -> float:
        """Time at which the last returned value was made [s from the start of the reference]."""
        ...


class SineSequence:
    """The article's protocol (Section 5): a sine on each DOF in succession.

    Insertion, rotation, bending, in this order: centre + amplitude sin(2 pi t / period) for the
    moving DOF, t from the start of its segment; the centre for the others, before the start and
    after the end. The position has no jump.

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
