"""A run of the loop on three simulated plays in the images of an ideal camera with noise."""

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
"""(features, features when the fault began, generator) -> measured features."""


@dataclass
class Run:
    """Traces and reports of a run."""

    tip: Floats
    command: Floats
    reports: list[Report]
    loop: HysteresisReduction


def config(profile: str = "best", **safety: object) -> Config:
    changes = {f"safety.{key}": value for key, value in safety.items()}
    return load_config(profile=profile).replace(**changes)  # type: ignore[arg-type]


def reference(time: float) -> Floats:
    """Strokes of 30 mm at up to 12.6 mm/s, with small motions of the other two DOFs."""
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
    actual: Config | None = None,
    motion: Callable[[float], Floats] = reference,
) -> Run:
    """Run the loop along `motion`; from `begin` to END the fault changes the features.

    `delay` gives the error of the capture time [s], None for a lost frame; `actual` is the geometry
    of camera and instrument [that of the settings].
    """
    loop, model = HysteresisReduction(settings), build_feature_model(actual or settings)
    noise, generator = np.random.default_rng(seed), np.random.default_rng(seed + 1)
    tip, tips, commands, reports = REST.copy(), [], [], []
    frozen: Floats | None = None
    for tick in range(round(until / PERIOD)):
        time = tick * PERIOD
        command = loop.step(motion(time), time)
        tip = np.clip(tip, command - WIDTHS / 2, command + WIDTHS / 2)
        tips.append(tip)
        commands.append(command)
        captured = tick - DELAY
        if captured < 0 or captured % 8:
            continue
        prediction = model.predict(tips[captured])
        seen = noise.normal(0.0, NOISE, 4)
        measured: Floats | None = None if prediction is None else prediction[0] + seen
        at = captured * PERIOD
        if begin <= at < END:
            assert measured is not None
            frozen = measured if frozen is None else frozen
            shift = delay(at)
            if shift is None:
                continue
            at += shift
            measured = measured if fault is None else fault(measured, frozen, generator)
        reports.append(loop.on_features(measured, at))
    return Run(np.array(tips), np.array(commands), reports, loop)


def insertion_error(one: Run, other: Run) -> float:
    """Largest difference of the insertion of both tips [m]."""
    return float(np.abs(one.tip[:, 0] - other.tip[:, 0]).max())
