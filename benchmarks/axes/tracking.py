"""Loops of 1 to 8 degrees of freedom on plays, and their computing time."""

import time
from collections.abc import Iterator

import numpy as np
from tautscope import Config, HysteresisReduction, PlayRig, Tip, axes, run_experiment
from tautscope.config import Sine
from tautscope.loop.references import OperatorMotion
from tautscope.report.tracking_bound import play_bound
from tautscope.runs.play_rig import EVERY

PLANTS = {"ideal": (1.0,), "rounded": (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)}
"""Radii of the parallel plays of each degree of freedom, over its half width."""
WIDTH_LIMIT, NOISE, DELAY = 1.2, 0.01, 0.05
AFTER = 40.0
"""Start of what counts [s]."""
Job = tuple[int, str, int]
"""Number of degrees of freedom, plant and seed."""


def config(count: int) -> Config:
    """The configuration of the loops."""
    return axes(count, width_limit=WIDTH_LIMIT)


class Plant(PlayRig):
    """Degrees of freedom with slack of 0.45 to 0.8 rad, drawn by the seed."""

    def __init__(self, job: Job) -> None:
        count, plant, seed = job
        rng = np.random.default_rng(seed)
        self.widths = rng.uniform(0.45, 0.8, count)
        slack = np.outer(self.widths, PLANTS[plant])
        super().__init__(config(count), slack, delay=DELAY, seed=rng)

    def measure(self, tip: np.ndarray, time: float) -> Iterator[Tip]:
        """Every degree of freedom."""
        if self.ticks % EVERY == 0:
            yield Tip(tip + self.rng.normal(0, NOISE, len(tip)), time)


def simulate(job: Job) -> list[float]:
    """Reduction of the RMS tracking error of each degree of freedom after 40 s of 120 s."""
    motion = motion_of(job)
    without, compensated = (
        run_experiment(Plant(job), motion, config(job[0]), compensate).tracking_rms(after=AFTER)
        for compensate in (False, True)
    )
    return list(1 - compensated / without)


def motion_of(job: Job) -> OperatorMotion:
    """The operator's motion of a job."""
    count, _, seed = job
    return OperatorMotion([Sine(centre=0.0, amplitude=1.0)] * count, seed)


def bound(job: Job) -> list[float]:
    """The same of a law with exact knowledge of ideal plays, without delay and noise."""
    motion, period = motion_of(job), config(job[0]).control.period
    reference = np.array([motion(time) for time in np.arange(0.0, motion.duration, period)])
    dofs = zip(reference.T, Plant(job).widths / 2, strict=True)
    return [play_bound(*own, first=round(AFTER / period)) for own in dofs]


def times(count: int, ticks: int = 4000) -> tuple[float, float]:
    """Median time of a control tick and of an update [s], with the Python interface."""
    loop, rig, motion = (
        HysteresisReduction(config(count)),
        Plant((count, "ideal", 0)),
        OperatorMotion([Sine(centre=0.0, amplitude=1.0)] * count, 0),
    )
    sample, spent, updates = rig.reset(), [], []
    for _ in range(ticks):
        begun = time.perf_counter()
        command = loop.step(motion(sample.time), sample.time)
        spent.append(time.perf_counter() - begun)
        for one in sample.measurements:
            begun = time.perf_counter()
            loop.on_sample(one)
            updates.append(time.perf_counter() - begun)
        sample = rig.step(command)
    return float(np.median(spent)), float(np.median(updates))
