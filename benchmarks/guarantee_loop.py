"""Goals of the loop as a whole: its time under load, and what its guards leave of its function."""

from __future__ import annotations

import gc
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fault_draws import configured
from guarantee_rows import Figure
from hysteresis_rows import insertion, stroke_widths, true_width
from hysteresis_runs import Simulation, uncompensated
from numpy.typing import NDArray
from tautscope import HysteresisReduction
from tautscope.config import Config, Profile
from tautscope.hardware.realtime import LOOP, realtime
from tautscope.loop.construction import build_feature_model
from tautscope.report.metrics import until_within
from tautscope.report.results import evaluate

TICK_P9999, TICK_MAX = 100e-6, 1e-3
"""Goals of a tick [s]."""
BUSY = 4
"""Processes beside it that compute, and one that writes."""
REST = 0.3e-3
"""Between two ticks; a real-time process that never rests is stopped by the kernel [s]."""
TICKS_PER_IMAGE = 8
SUMMED = 1000
"""Integers whose sum takes about as long as a tick."""
REDUCTION = 0.75
SLACK_CHANGES = 20.0, 5.0
"""When it begins to, and how long it takes [s]."""
STROKES, TRACKED = 2, 0.1
"""Goals once it has."""

Floats = NDArray[np.float64]

_COMPUTE = "while True: pass"
_WRITE = """
import os, sys
with open(sys.argv[1], "wb", buffering=0) as file:
    while True:
        file.seek(0); file.write(bytes(1_000_000)); os.fsync(file.fileno())
"""


@dataclass(frozen=True)
class _Times:
    """Of each tick [s].

    Attributes:
        wall: From its start to its end.
        own: What the thread computed in it.
        sum: Wall time of a sum of integers beside it, which needs next to no memory: what the
            machine adds to any tick.
    """

    wall: Floats
    own: Floats
    sum: Floats

    def missed(self) -> int:
        """How many of the two goals."""
        rare, worst = _tail(self.wall)
        return int(rare > TICK_P9999) + int(worst > TICK_MAX)

    def text(self) -> str:
        """All of it."""
        parts = (("", self.wall), ("of its own ", self.own), ("a sum beside it ", self.sum))
        return ", ".join(
            f"{name}{1e6 * np.median(times):.0f} / "
            + " / ".join(f"{1e6 * value:.0f} us" for value in _tail(times))
            for name, times in parts
        )


def _tail(times: Floats) -> tuple[float, float]:
    """Quantile of 99.99 %, and the largest."""
    return float(np.quantile(times, 0.9999)), float(times.max())


def ticks_under_load(count: int) -> Figure:
    """G13: the tick with three DOFs, through Python, images between; median, p99.99 and largest.

    With the priority that the loop has on hardware (`tautscope.hardware.realtime`), which the goal
    is for, and, a tenth as often, without.
    """
    with _load():
        with realtime(LOOP) as refused:
            first = _ticks(count)
        plain = _ticks(max(count // 10, 100))
    name = "SCHED_FIFO" if not refused else "no SCHED_FIFO here"
    text = f"{name}: {first.text()}; without it: {plain.text()}"
    return Figure(text, f"{len(first.wall)}; {len(plain.wall)}", first.missed(), "13")


def _ticks(count: int) -> _Times:
    config = configured(13, "best", ())
    loop, model = HysteresisReduction(config), build_feature_model(config)
    period, chance = config.control.period, np.random.default_rng(13)
    centres = np.array([0.025, 0.0, 0.9])
    reach = np.array([15e-3, 1.5, 0.6])
    times = _Times(*np.empty((3, count)))
    gc.disable()
    for tick in range(count):
        now = tick * period
        reference = centres + reach * np.sin(2 * np.pi * now / np.array([7.5, 10.0, 11.0]))
        own, begin = time.thread_time(), time.perf_counter()
        command = loop.step(reference, now)
        times.wall[tick] = time.perf_counter() - begin
        times.own[tick] = time.thread_time() - own
        if tick % TICKS_PER_IMAGE == 0 and (seen := model.predict(command)) is not None:
            loop.on_features(seen[0] + 0.2 * chance.standard_normal(4), now)
        time.sleep(REST)
        begin = time.perf_counter()
        sum(range(SUMMED))
        times.sum[tick] = time.perf_counter() - begin
        time.sleep(REST)
    gc.enable()
    return times


@contextmanager
def _load() -> Iterator[None]:
    with tempfile.TemporaryDirectory() as folder:
        commands = [[sys.executable, "-c", _COMPUTE]] * BUSY
        commands.append([sys.executable, "-c", _WRITE, str(Path(folder) / "load")])
        running = [subprocess.Popen(command) for command in commands]
        try:
            yield
        finally:
            for each in running:
                each.kill()
            for each in running:
                each.wait()


def function(seed: int = 24) -> Figure:
    """G24: the article's protocol, and a scope that straightens, with all guards on."""
    found = [_function(profile, seed) for profile in ("paper", "best")]
    return found[0].beside(found[1])


def _function(profile: Profile, seed: int) -> Figure:
    config = configured(seed, profile, ())
    results = evaluate(uncompensated(config).run(), Simulation(config, images=False).run())
    worst = min(1 - abs(1 - each.reduction) for each in results.values())
    strokes = _strokes(config)
    text = f"{profile}: {100 * worst:.1f} %, slack followed in {strokes:.3g} strokes"
    missed = int(worst < REDUCTION) + int(not strokes <= STROKES)
    return Figure(text, "2", missed, str(seed))


def _strokes(config: Config) -> float:
    """How many until the slack believed in is within a tenth of the true one, now smaller."""
    bent, period = config.twin.bends, config.experiment.insertion.period
    begin, lasts = SLACK_CHANGES
    # Slack grows with the bends, from 2 mm without any: half of them leave 6 of 10 mm.
    half = bent / 2
    bends = ((begin, bent), (begin + lasts, half))
    motion = insertion(config, 8)
    run = Simulation(config, motion, bends=bends, images=False).run()
    straight = config.replace(**{"twin.bends": half})
    true = true_width(uncompensated(straight, insertion(config, 3)).run())
    last = stroke_widths(run, (begin + lasts) / period, 8)
    return until_within(last, true, TRACKED * true)
