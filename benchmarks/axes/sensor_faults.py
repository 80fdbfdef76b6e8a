"""Faults of the sensor of a robot with [[dof]]: how far they move the tip, and whether it is said.

As the campaign of `benchmarks/faults` does for images. Goals are its shares of the slack that the
loop compensates.
"""

import math
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from faults.evaluation import detection_time, excursion
from faults.recorder import Floats, RunRecorder
from tautscope import HysteresisReduction, PlayRig, Sample, Tip, axes
from tautscope.config import Sine
from tautscope.loop.references import OperatorMotion
from tautscope.runs.play_rig import EVERY

WIDTH_LIMIT, NOISE = 1.0, 0.003
"""Of each degree of freedom, and of its sensor [rad]."""
DELAY, DURATION = 0.05, 30.0
"""Of the sensor, and of a run [s]."""
SEEDS = 40
EARLY, LATE = (0.0, 3.0), (15.0, 22.5)
"""When faults begin [s]: mostly before the first reversal, and later."""
TRANSIENT = (0.1, 2.0)
"""Duration of a transient fault [s]."""
GOALS = {True: 0.1 * WIDTH_LIMIT, False: 1.03 * WIDTH_LIMIT}
"""Largest motion of the tip by a transient fault, and by a permanent one [rad]."""


class Job(NamedTuple):
    """Kind of the fault, or ``none``; whether it begins early; seed."""

    kind: str
    is_early: bool
    seed: int


class Fault:
    """A fault of the values (n,) of a sensor, drawn by the seed.

    It begins at `start` [s] and ends at `end`, with even seeds never. It hits the first value, or
    all, as drawn.
    """

    def __init__(self, job: Job) -> None:
        rng = np.random.default_rng([job.seed, 1])
        self.kind, self._rng = job.kind, rng
        self.start = rng.uniform(*(EARLY if job.is_early else LATE))
        self.is_transient = bool(job.seed % 2)
        lasts = rng.uniform(*TRANSIENT)
        self.end = self.start + lasts if self.is_transient else math.inf
        self._which = [np.array([True, True]), np.array([True, False])][rng.integers(2)]
        self._severity, self.sign = rng.uniform(), float(rng.choice([-1.0, 1.0]))
        self.past: deque[Floats] = deque(maxlen=5 + int(20 * self._severity))
        self._held = np.zeros(2)

    def __call__(self, values: Floats, time: float) -> Floats | None:
        """The values with the fault; None if nothing arrives."""
        self.past.append(values)
        if not self.start <= time < self.end or self.kind == "none":
            self._held = values
            return values
        if self.kind == "silent":
            return None
        return np.where(self._which, KINDS[self.kind](self, values, time), values)

    def scaled(self, low: float, high: float) -> float:
        """The severity between two limits."""
        return low + self._severity * (high - low)

    def some(self, values: Floats) -> Floats:
        """Wrong values in a part of the measurements."""
        wrong = values + self._rng.uniform(-1, 1, 2)
        return wrong if self._rng.uniform() < self.scaled(0.05, 0.5) else values

    def noisy(self, values: Floats) -> Floats:
        """More noise."""
        return values + self._rng.normal(0, self.scaled(0.01, 0.2), 2)

    def held(self, noise: float) -> Floats:
        """The last values before the fault."""
        return self._held + self._rng.normal(0, noise, 2)

    def offset(self) -> float:
        """A constant [rad]."""
        return self.sign * self.scaled(0.05, 0.6)

    def drift(self, time: float) -> float:
        """It grows [rad]."""
        return self.sign * self.scaled(0.02, 0.3) * (time - self.start)


KINDS: dict[str, Callable[[Fault, Floats, float], Floats]] = {
    "biased": lambda fault, values, _: values + fault.offset(),
    "drifting": lambda fault, values, time: values + fault.drift(time),
    "frozen": lambda fault, *_: fault.held(0.0),
    "frozen_noisy": lambda fault, *_: fault.held(NOISE),
    "noisy": lambda fault, values, _: fault.noisy(values),
    "outliers": lambda fault, values, _: fault.some(values),
    "scaled": lambda fault, values, _: values * fault.scaled(0.5, 1.5),
    "reversed": lambda _, values, __: -values,
    "swapped": lambda _, values, __: values[::-1],
    "late_unknown": lambda fault, *_: fault.past[0],
    "not_measured": lambda _, values, __: np.array([np.nan, values[1]]),
    "silent": lambda _, values, __: values,
}


class Plant(PlayRig):
    """Two degrees of freedom, mostly at an end of their slack, which the seed draws as the rest."""

    def __init__(self, job: Job) -> None:
        rng = np.random.default_rng([job.seed, 0])
        config = axes(2, width_limit=WIDTH_LIMIT)
        self._start = rng.choice([-1.0, 0.0, 1.0], (2, 1))
        self.motion = OperatorMotion(
            [Sine(centre=0.0, amplitude=rng.choice([0.5, 1.0, 1.5]))] * 2, job.seed, DURATION
        )
        radii = [(1.0,), (0.5, 0.75, 1.0, 1.25, 1.5)][rng.integers(2)]
        super().__init__(
            config.replace(**{"measurement.tip_deviation": NOISE}),
            np.outer(rng.uniform(0.3, 0.8, 2), radii),
            gains=rng.uniform(0.8, 1.1, 2),
            delay=DELAY,
            seed=job.seed,
        )
        self.fault = Fault(job)

    def reset(self) -> Sample:
        """At command 0, at the drawn place in the slack."""
        super().reset()
        self._plays = self._start * self._half
        return self.step([0.0, 0.0])

    def measure(self, tip: Floats, time: float) -> Iterator[Tip]:
        """Every degree of freedom, with the fault."""
        if self.ticks % EVERY:
            return
        values = self.fault(tip + self.rng.normal(0.0, NOISE, 2), time)
        if values is not None:
            yield Tip(values, time)


class Outcome(NamedTuple):
    """Largest motion of the tip by the fault [rad], and when it was said [s from its beginning]."""

    excursion: float
    detected: float


def simulate(job: Job) -> Outcome:
    """The tip with the fault against the tip without, from the beginning of the fault on."""
    start = Plant(job).fault.start
    tip, summary = _run(job, start)
    nominal, usual = _run(job._replace(kind="none"), start)
    times = (
        detection_time(each, usual["flags"].get(name, ()))
        for name, each in summary["flags"].items()
    )
    moved = excursion(tip, nominal, summary["stop_tick"])
    return Outcome(float(moved.max()), min(times, default=math.inf))


def _run(job: Job, start: float) -> tuple[Floats, dict[str, Any]]:
    plant = Plant(job)
    period, sample = plant.control_period, plant.reset()
    loop = HysteresisReduction(plant.config)
    recorder = RunRecorder(lambda: sample.time, start, period, loop=loop)
    tips = []
    while sample.time < DURATION:
        for measurement in sample.measurements:
            loop.on_sample(measurement)
        reference = plant.motion(sample.time)
        command = loop.step(reference, sample.time)
        recorder.tick(sample, reference, command)
        if sample.time >= start:
            tips.append(sample.true_state)
        sample = plant.step(command)
    return np.array(tips), recorder.summary()


def table(found: dict[Job, Outcome]) -> str:
    """A Markdown table: a line per kind, early and late faults side by side."""
    lines = ["| fault | within 3 s | after 15 s | detected |", "|---|---|---|--:|"]
    for kind in KINDS:
        own = {job: each for job, each in found.items() if job.kind == kind}
        early, late = (
            _summary({job: own[job] for job in own if job.is_early is is_early})
            for is_early in (True, False)
        )
        detected = np.mean([math.isfinite(each.detected) for each in own.values()])
        lines.append(f"| {kind} | {early} | {late} | {detected:.0%} |")
    return "\n".join(lines)


def _summary(found: dict[Job, Outcome]) -> str:
    beyond = [job for job, each in found.items() if each.excursion > GOALS[Fault(job).is_transient]]
    silent = sum(math.isinf(found[job].detected) for job in beyond)
    worst = max(each.excursion for each in found.values())
    return f"{len(beyond)} ({silent}), {worst:.2f}"
