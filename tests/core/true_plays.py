"""A run of the loop on three true plays, seen by an ideal camera with noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config, load_config
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import HysteresisReduction, Report

Floats = NDArray[np.float64]
WIDTHS = np.array([10e-3, 1.8, 1.1])
REST = np.array([0.025, 0.0, 0.9])
PERIOD = 0.005
BEGIN, END = 20.0, 22.0
"""Of the fault [s]."""
DELAY = 16
"""Ticks from capture to arrival."""
NOISE = 0.1
"""[px]."""

Fault = Callable[[Floats, Floats, np.random.Generator], Floats | None]
"""(features now, features when the fault began, chance) -> what arrives."""


@dataclass
class Run:
    """What happened."""

    tip: Floats
    command: Floats
    reports: list[Report]
    loop: HysteresisReduction


def config(profile: str = "best", **safety: object) -> Config:
    changes = {f"safety.{key}": value for key, value in safety.items()}
    # The stand-in's plays know nothing of each other.
    changes["adaptive.one_friction"] = False
    return load_config(profile=profile).replace(**changes)  # type: ignore[arg-type]


def reference(time: float) -> Floats:
    """Strokes of 30 mm at up to 12.6 mm/s, and some of the other two."""
    wave = np.sin(12.6 / 15 * time)
    return REST + np.array([15e-3 * wave, 0.3 * wave, 0.1 * wave])


def run(
    settings: Config,
    fault: Fault | None = None,
    seed: int = 0,
    until: float = 30.0,
    delay: Callable[[float], float | None] = lambda time: 0.0,
    *,
    begin: float = BEGIN,
) -> Run:
    """The same hand, the same noise; from `begin` to END the fault sees to the images."""
    loop, model = HysteresisReduction(settings), build_feature_model(settings)
    noise, chance = np.random.default_rng(seed), np.random.default_rng(seed + 1)
    tip, tips, commands, reports = REST.copy(), [], [], []
    frozen: Floats | None = None
    for tick in range(round(until / PERIOD)):
        time = tick * PERIOD
        command = loop.step(reference(time), time)
        tip = np.clip(tip, command - WIDTHS / 2, command + WIDTHS / 2)
        tips.append(tip)
        commands.append(command)
        captured = tick - DELAY
        if captured < 0 or captured % 8:
            continue
        prediction = model.predict(tips[captured])
        assert prediction is not None
        seen: Floats | None = prediction[0] + noise.normal(0.0, NOISE, 4)
        at = captured * PERIOD
        if begin <= at < END:
            assert seen is not None
            frozen = seen if frozen is None else frozen
            shift = delay(at)
            if shift is None:
                continue
            at += shift
            seen = seen if fault is None else fault(seen, frozen, chance)
        reports.append(loop.on_features(seen, at))
    return Run(np.array(tips), np.array(commands), reports, loop)


def excursion(one: Run, other: Run) -> float:
    """Largest difference of the tips' insertion [m]."""
    return float(np.abs(one.tip[:, 0] - other.tip[:, 0]).max())
