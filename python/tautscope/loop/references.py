"""Reference trajectories: where the tip should be, and which DOF moves when."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from tautscope.config import Config, ExperimentConfig, Sine
from tautscope.dof import Dof, NamedDof
from tautscope.errors import SignalError
from tautscope.loop.kinematics import Floats
from tautscope.loop.signal_checks import as_numbers

Value = TypeVar("Value", float, Floats)


@dataclass(frozen=True, slots=True)
class Segment:
    """A part of a reference in which one DOF repeats a motion.

    Attributes:
        dof: The DOF that moves, one of `Config.dofs`.
        start: When it begins [s from the start of the reference].
        period: Period of the motion [s].
        periods: Number of periods.
    """

    dof: NamedDof
    start: float
    period: float
    periods: int

    @property
    def end(self) -> float:
        """When it ends [s from the start of the reference]."""
        return self.start + self.period * self.periods


class Motion(Protocol):
    """A desired motion of the tip; (n,) for n degrees of freedom."""

    @property
    def duration(self) -> float:
        """Duration [s]."""

    def __call__(self, time: float) -> Floats:
        """(n,) [m or rad] at `time` [s from its start]."""


class Reference(Motion, Protocol):
    """A motion whose parts are known."""

    @property
    def segments(self) -> Sequence[Segment]:
        """Which DOF moves when; may be empty."""


@runtime_checkable
class DatedReference(Reference, Protocol):
    """A reference from an input device, which may arrive late or not at all, with its time.

    A reference computed when it is called needs none.
    """

    @property
    def made_at(self) -> float:
        """Time at which the last returned value was made [s from the start of the reference]."""


class SineSequence:
    """The article's protocol (Section 5): a sine on each DOF in succession.

    Insertion, rotation, bending, in this order: centre + amplitude sin(2 pi t / period) for the
    moving DOF, t from the start of its segment; the centre for the others, before the start and
    after the end. The position has no jump.

    Args:
        experiment: Centre, amplitude and period per DOF; number of periods.
        periods: In place of this number.
    """

    def __init__(self, experiment: ExperimentConfig, periods: int | None = None) -> None:
        self._sines = [experiment[dof] for dof in Dof]
        self._centre = np.array([sine.centre for sine in self._sines])
        segments: list[Segment] = []
        start = 0.0
        for dof, sine in zip(Dof, self._sines, strict=True):
            segments.append(Segment(dof, start, sine.period, periods or experiment.periods))
            start = segments[-1].end
        self.segments: tuple[Segment, ...] = tuple(segments)
        self.duration: float = start

    def __repr__(self) -> str:
        parts = (f"{each.dof.label} {each.start:g} to {each.end:g} s" for each in self.segments)
        return f"<SineSequence: {', '.join(parts)}>"

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        position = self._centre.copy()
        for dof, (segment, sine) in enumerate(zip(self.segments, self._sines, strict=True)):
            if segment.start <= time < segment.end:
                phase = 2 * np.pi * (time - segment.start) / sine.period
                position[dof] += sine.amplitude * np.sin(phase)
        return position


MINIMUM_JERK_PEAK = 15 / 8
"""Peak speed of a minimum-jerk move over its mean speed."""
APPROACH_SPEED = 0.5
"""Largest speed of the approach to a recorded motion [of `safety.reference_speed`]."""
TREMOR, TREMOR_FREQUENCY = (0.1e-3, 0.01, 0.01), 8.0
"""Amplitude [m, rad, rad], and frequency [Hz]."""
TREMOR_SHARE = 1 / 150
"""Amplitude for another robot [in that of the motion]."""
FASTEST = 1.2
"""Largest speed of a move that is no flick [amplitudes per s]."""
FLICKS, PAUSES = 0.2, 0.1
"""Share of the moves that are flicks, and of the rests that are pauses."""


@dataclass(frozen=True)
class OperatorMotion:
    """Random moves of all DOFs at once, as an operator makes them; seeded.

    Each DOF by itself: a minimum-jerk move (Flash and Hogan 1985) from a to a target b, drawn
    uniformly from centre +- amplitude,

        u = a + (b - a) (10 x^3 - 15 x^4 + 6 x^5),    x = elapsed / D

    with D = max(U(1, 4) s, 15/8 |b - a| / speed limit) and a speed limit of 1.2 amplitudes per
    second; then a rest of U(0, 1.5) s. With `is_disturbed` there is a tremor of 8 Hz and 0.1 mm or
    0.01 rad, every fifth move on average is a flick at 3 amplitudes per second, and every tenth
    rest a pause of 5 s.

    Attributes:
        experiment: Centre and amplitude per DOF: a section, or of another robot a `Sine` each, with
            a tremor of a 150th of its amplitude.
        seed: Of all that is random.
        duration: [s].
        is_disturbed: Whether tremor, flicks and pauses are added.
    """

    experiment: ExperimentConfig | Sequence[Sine]
    seed: int
    duration: float = 120.0
    is_disturbed: bool = False
    segments: ClassVar[tuple[Segment, ...]] = ()

    @cached_property
    def _moves(self) -> list[list[tuple[float, ...]]]:
        rng = np.random.default_rng(self.seed)
        return [self._draw_moves(sine, rng) for sine in self._sines]

    @property
    def _sines(self) -> Sequence[Sine]:
        given = self.experiment
        return [given[dof] for dof in Dof] if isinstance(given, ExperimentConfig) else given

    @property
    def _tremor(self) -> Floats:
        if isinstance(self.experiment, ExperimentConfig):
            return np.array(TREMOR)
        return np.array([TREMOR_SHARE * sine.amplitude for sine in self._sines])

    def _draw_moves(self, sine: Sine, rng: np.random.Generator) -> list[tuple[float, ...]]:
        """Moves, each start [s], D [s], a, b."""
        moves: list[tuple[float, ...]] = []
        time, position = 0.0, sine.centre
        while time < self.duration:
            least = rng.uniform(1.0, 4.0)
            target = sine.centre + sine.amplitude * rng.uniform(-1, 1)
            rest, speed = rng.uniform(0.0, 1.5), FASTEST * sine.amplitude
            if self.is_disturbed:
                if rng.uniform() < FLICKS:
                    least, speed = 0.0, 3 * sine.amplitude
                if rng.uniform() < PAUSES:
                    rest = 5.0
            lasts = max(least, MINIMUM_JERK_PEAK * abs(target - position) / speed)
            moves.append((time, lasts, position, target))
            time, position = time + lasts + rest, target
        return moves

    def __call__(self, time: float) -> Floats:
        """(n,) [m or rad] at `time` [s from the start of the reference]."""
        position = np.empty(len(self._moves))
        for dof, moves in enumerate(self._moves):
            index = max(bisect_right(moves, time, key=itemgetter(0)) - 1, 0)
            start, lasts, a, b = moves[index]
            position[dof] = _minimum_jerk(a, b, (time - start) / lasts)
        if self.is_disturbed:
            position += self._tremor * np.sin(2 * np.pi * TREMOR_FREQUENCY * time)
        return position


class Move:
    """A minimum-jerk move of all DOFs between two positions (n,) [m or rad].

    u = a + (b - a) (10 x^3 - 15 x^4 + 6 x^5), x = time / duration, as fast as `speed` (n,) allows,
    in at least a time [s].
    """

    def __init__(self, start: Floats, end: Floats, speed: Floats, least: float) -> None:
        self._ends = start.copy(), end
        self.duration = max(least, MINIMUM_JERK_PEAK * float((np.abs(end - start) / speed).max()))

    def __call__(self, time: float) -> Floats:
        """(n,) [m or rad] at `time` [s from its start]."""
        return _minimum_jerk(*self._ends, time / self.duration)


class RecordedReference:
    """A recorded motion of an operator, after a slow approach from the centres of the experiment.

    Linear between the rows of the record. The approach is a minimum-jerk move of at most half of
    `safety.reference_speed`, of at least 1 s. The whole motion is known beforehand, so that the
    reference has no `made_at`.

    Args:
        time: (n,) [s], increasing; n at least 2.
        position: (n, 3) [m, rad, rad].
        config: `experiment` has the centres.

    Raises:
        SignalError: Time or position is not as described, or there are other than 3 DOFs.
    """

    segments: ClassVar[tuple[Segment, ...]] = ()

    def __init__(self, time: ArrayLike, position: ArrayLike, config: Config) -> None:
        if len(config.dofs) != len(Dof):
            found, allowed = (", ".join(dof.label for dof in dofs) for dofs in (config.dofs, Dof))
            raise SignalError("config.dofs", found, allowed)
        stamps = as_numbers("time", time, "an array (n,)")
        if stamps.ndim != 1 or len(stamps) < 2:
            raise SignalError("time", f"an array {stamps.shape}", "an array (n,), n at least 2")
        is_bad = ~np.isfinite(stamps)
        is_bad[1:] |= ~(stamps[1:] > stamps[:-1])
        if is_bad.any():
            at = int(np.argmax(is_bad))
            raise SignalError(f"time[{at}]", float(stamps[at]), "a finite time after the last one")
        shape = len(stamps), len(Dof)
        self._position = np.array(as_numbers("position", position, f"an array {shape}"))
        if self._position.shape != shape:
            raise SignalError("position", f"an array {self._position.shape}", f"an array {shape}")
        for at in np.flatnonzero(~np.isfinite(self._position).all(axis=1))[:1]:
            row = self._position[at].tolist()
            raise SignalError(f"position[{at}]", row, "finite numbers [m, rad, rad]")
        centre = np.array([config.experiment[dof].centre for dof in Dof])
        slow = APPROACH_SPEED * np.array(config.safety.reference_speed)
        self._approach = Move(centre, self._position[0], slow, 1.0)
        self.approach = self._approach.duration
        """Duration of the approach [s]."""
        self._time = stamps - stamps[0] + self.approach
        self.duration: float = float(self._time[-1])

    def __repr__(self) -> str:
        return f"<RecordedReference: {len(self._time)} rows, {self.duration:g} s>"

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        if time < self.approach:
            return self._approach(time)
        return np.array([np.interp(time, self._time, each) for each in self._position.T])


def _minimum_jerk(a: Value, b: Value, x: float) -> Value:
    """Position of a minimum-jerk move from a to b after the share x of its duration."""
    x = min(max(x, 0.0), 1.0)
    return a + (b - a) * x**3 * (10 - 15 * x + 6 * x**2)
