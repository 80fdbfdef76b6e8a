"""One run of a controller on a drawn instrument, with a given latency and loss of images."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from common.features import NOISE
from common.small_images import full_size
from instruments.properties import draw_instrument
from instruments.rival_controllers import (
    Calibration,
    ConstantCompensation,
    Controller,
    Loop,
    NoCompensation,
    VisualServoing,
)
from instruments.runs import LEAST_VISIBLE, without_image_effects
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import OperatorMotion
from tautscope.loop.rig import Frame
from tautscope.report import metrics
from tautscope.report.operator_motion import EVALUATED_AFTER
from tautscope.twin import Twin

Floats = NDArray[np.float64]
Name = Literal["none", "best", "visual servoing", "constant compensation"]
NAMES: tuple[Name, ...] = ("none", "best", "visual servoing", "constant compensation")
Triple = tuple[float, float, float]
REST = 14.0
"""Time after the operator's motion; in its last 10 s every reference rests [s]."""
CALIBRATION_PERIODS, CALIBRATION_AMPLITUDE = 2, 1.5
"""Periods of the sine by which an instrument is calibrated, the last of which counts, and its
amplitude over that of the experiment."""
LEVELS, CENTRAL = 41, 0.8
"""Levels at which a loop is measured, and the part of the tip's range over which they lie."""


@dataclass(frozen=True, slots=True)
class RivalRun:
    """Complete description of a run under an operator's motion.

    Attributes:
        seed: Of instrument, motion, noise and loss.
        name: Controller.
        latency: Capture to arrival of an image [s].
        loss: Share of the images that are lost.
        gains: (3,) of visual servoing [1/s], or free gain of constant compensation.
        duration: Of the operator's motion [s].
        rest: Time after it [s].
    """

    seed: int
    name: Name
    latency: float
    loss: float
    gains: Triple
    duration: float = 120.0
    rest: float = REST


@dataclass(frozen=True, slots=True)
class RivalFigures:
    """Figures of a run; lists are per DOF [m, rad, rad].

    Attributes:
        spread: Standard deviation of (true tip - reference) under the operator's motion.
        creep: Travel of the tip while every reference rests, noise of the simulation included.
    """

    spread: list[float]
    creep: list[float]


def simulate(run: RivalRun) -> RivalFigures:
    """Simulate a run."""
    drawn = draw_instrument(run.seed)
    changes = {"twin.latency": run.latency, "twin.latency_jitter": 0.0}
    actual, told = drawn.actual.replace(**changes), drawn.told.replace(**changes)
    controller = _make_controller(run, told)
    uses_images = run.name in {"best", "visual servoing"}
    twin = Twin(without_image_effects(actual), images=uses_images)
    noise, losses = (np.random.default_rng([run.seed, part]) for part in (1, 2))
    motion = OperatorMotion(told.experiment, run.seed, run.duration)
    references, tips, times = [], [], []
    sample = twin.reset()
    while sample.time < run.duration + run.rest:
        reference = motion(sample.time)
        command = controller.step(reference, sample.time)
        references.append(reference)
        tips.append(sample.true_state)
        times.append(sample.time)
        if sample.frame is not None and losses.uniform() >= run.loss:
            controller.update(_features(sample.frame, noise), sample.frame.captured_at)
        sample = twin.step(command)
    twin.close()
    return _figures(np.array(times), np.array(references), np.array(tips), run.duration)


def _figures(times: Floats, references: Floats, tips: Floats, duration: float) -> RivalFigures:
    late = times >= min(EVALUATED_AFTER, duration / 3)
    moving = late & (times < duration)
    spread = (tips - references)[moving].std(axis=0)
    creep = [metrics.creep(references[late], tips[late, dof]) for dof in Dof]
    return RivalFigures(spread.tolist(), creep)


def _features(frame: Frame, noise: np.random.Generator) -> Floats | None:
    assert frame.true_features is not None and frame.true_visible is not None
    is_visible = frame.true_visible >= LEAST_VISIBLE
    features = full_size(frame.true_features) + NOISE * noise.standard_normal(4)
    features[~np.repeat(is_visible, 2)] = np.nan
    return features if is_visible.any() else None


def _make_controller(run: RivalRun, told: Config) -> Controller:
    gains = np.array(run.gains)
    makers: dict[Name, Callable[[], Controller]] = {
        "none": NoCompensation,
        "best": lambda: Loop(told),
        "visual servoing": lambda: VisualServoing(told, gains),
        "constant compensation": lambda: ConstantCompensation(calibrate(run.seed), gains),
    }
    return makers[run.name]()


@cache
def calibrate(seed: int) -> Calibration:
    """Calibrate a drawn instrument: a sine on each DOF without compensation, and its true tip."""
    actual = without_image_effects(draw_instrument(seed).actual)
    centre = np.array([actual.experiment[dof].centre for dof in Dof])
    loops = []
    for dof in Dof:
        sine, twin = actual.experiment[dof], Twin(actual, images=False)
        sample = twin.reset()
        commands, tips = [], []
        while sample.time < CALIBRATION_PERIODS * sine.period:
            command = centre.copy()
            phase = 2 * np.pi * sample.time / sine.period
            command[dof] += CALIBRATION_AMPLITUDE * sine.amplitude * np.sin(phase)
            assert sample.true_state is not None
            commands.append(command[dof] - centre[dof])
            tips.append(sample.true_state[dof] - centre[dof])
            sample = twin.step(command)
        twin.close()
        # The last period, from its largest command on.
        last = round((CALIBRATION_PERIODS - 1) / CALIBRATION_PERIODS * len(tips))
        lag = -int(np.argmax(commands[last:]))
        loops.append(measure_loop(*(np.roll(each[last:], lag) for each in (commands, tips))))
    return Calibration(*zip(*loops, strict=True))


def measure_loop(command: Floats, tip: Floats) -> Triple:
    """Gain and contact offsets delta_minus, delta_plus of one period of a loop.

    At each level y of the tip, the rising branch has command r and the falling one f. With
    y = gain c - offset, the gain is the slope of y over (r + f) / 2, and the offsets are the means
    of gain f - y and gain r - y.

    Args:
        command: (n,) from its largest value on, over one period.
        tip: (n,) likewise, in the same unit.
    """
    turn = int(np.argmin(command))
    low, high = np.quantile(tip, (0.0, 1.0))
    edge = (1 - CENTRAL) / 2 * (high - low)
    levels = np.linspace(low + edge, high - edge, LEVELS)
    # Noise of the tip: each branch is made monotonic.
    falling = np.minimum.accumulate(tip[:turn])[::-1]
    rising = np.maximum.accumulate(tip[turn:])
    f = np.interp(levels, falling, command[:turn][::-1])
    r = np.interp(levels, rising, command[turn:])
    gain = float(np.polyfit((r + f) / 2, levels, 1)[0])
    return gain, float((gain * f - levels).mean()), float((gain * r - levels).mean())
