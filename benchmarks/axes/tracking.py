"""Loops of 1 to 8 degrees of freedom on plays, and their computing time."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import ArrayLike
from tautscope import Config, HysteresisReduction, Sample, Tip, axes, run_experiment
from tautscope.config import Sine
from tautscope.loop.references import OperatorMotion

PLANTS = {"ideal": (1.0,), "rounded": (0.25, 0.5, 0.75, 1.0, 1.25, 1.5)}
"""Radii of the parallel plays of each degree of freedom, over its half width."""
WIDTH_LIMIT, NOISE, DELAY = 1.2, 0.01, 0.05
Job = tuple[int, str, int]
"""Number of degrees of freedom, plant and seed."""


class PlayRig:
    """Degrees of freedom with slack of 0.45 to 0.8 rad, drawn by the seed."""

    control_period = 0.005

    def __init__(self, job: Job) -> None:
        count, plant, seed = job
        self._rng = np.random.default_rng(seed)
        widths = self._rng.uniform(0.45, 0.8, count)
        self._half = np.outer(widths / 2, PLANTS[plant])
        self.reset()

    def reset(self) -> Sample:
        """All plays at rest in their middle."""
        self._plays, self._ticks = np.zeros_like(self._half), 0
        self._waiting: list[Tip] = []
        return self.step(np.zeros(len(self._half)))

    def step(self, command: ArrayLike) -> Sample:
        """Move the plays; every fifth tick the tip is measured."""
        motors = np.asarray(command, dtype=np.float64)[:, None]
        self._plays = np.clip(self._plays, motors - self._half, motors + self._half)
        self._ticks += 1
        tip, now = self._plays.mean(axis=1), self._ticks * self.control_period
        if self._ticks % 5 == 0:
            self._waiting.append(Tip(tip + self._rng.normal(0, NOISE, len(tip)), now))
        arrived = tuple(each for each in self._waiting if each.captured_at <= now - DELAY)
        self._waiting = self._waiting[len(arrived) :]
        return Sample(now, motors[:, 0], true_state=tip, measurement=arrived)

    def close(self) -> None:
        """Nothing to stop."""


def config(count: int) -> Config:
    """The configuration of the loops."""
    return axes(count, width_limit=WIDTH_LIMIT)


def simulate(job: Job) -> list[float]:
    """Reduction of the RMS tracking error of each degree of freedom after 40 s of 120 s."""
    count, _, seed = job
    motion = OperatorMotion([Sine(centre=0.0, amplitude=1.0)] * count, seed)
    without, compensated = (
        run_experiment(PlayRig(job), motion, config(count), compensate).tracking_rms(after=40.0)
        for compensate in (False, True)
    )
    return list(1 - compensated / without)


def times(count: int, ticks: int = 4000) -> tuple[float, float]:
    """Median time of a control tick and of an update [s], with the Python interface."""
    loop, rig, motion = (
        HysteresisReduction(config(count)),
        PlayRig((count, "ideal", 0)),
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
