"""Delay of a sensor's time stamps, from a motion without compensation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.errors import CalibrationError
from tautscope.loop.kinematics import build_kinematics
from tautscope.loop.measurement import Measurement, Sensors
from tautscope.loop.reduction import HysteresisReduction, Status
from tautscope.loop.references import Reference
from tautscope.loop.rig import Rig, check_sample

LONGEST, COARSE, FINE = 0.25, 0.025, 0.005
"""Longest delay that is sought, and steps of the search [s]."""
LEAST_UPDATES, RATE = 200, 10.0
"""Measurements that are needed, and at most looked at per second."""
SYSTEMATIC = 0.01
"""Standard deviation of what the filter's offset takes for a delay, or the reverse [s]."""
BLOCKS = 8
"""Parts of the motion from whose differences the standard deviation comes."""


@dataclass(frozen=True, eq=False)
class Passage:
    """Times (ticks,) [s] and commands (ticks, n) [m or rad] of a motion, and what was measured."""

    times: NDArray[np.float64]
    commands: NDArray[np.float64]
    measurements: tuple[tuple[int, Measurement], ...]
    """With the tick in which each arrived."""


@dataclass(frozen=True, slots=True)
class SensorDelay:
    """How much earlier than its time stamps say a sensor measures.

    Attributes:
        delay: To subtract from the time stamps [s].
        std: Its standard deviation [s]: of the parts of the motion, and `SYSTEMATIC`.
        misfit: Mean absolute innovation at `delay` over that without it.
    """

    delay: float
    std: float
    misfit: float


def move(
    rig: Rig, motion: Reference, config: Config, progress: Callable[[float], None] | None = None
) -> Passage:
    """Move a rig without compensation: the command is the reference.

    Raises:
        SignalError: A sample is not as `tautscope.Sample` says.
    """
    sample = check_sample(rig.reset(), config)
    start = sample.time
    times: list[float] = []
    commands: list[NDArray[np.float64]] = []
    measurements: list[tuple[int, Measurement]] = []
    while (elapsed := sample.time - start) < motion.duration:
        command = motion(elapsed)
        measurements += [(len(times), each) for each in sample.measurements]
        times.append(sample.time)
        commands.append(command)
        sample = check_sample(rig.step(command), config)
        if progress is not None and len(times) % 200 == 0:
            progress(min(elapsed / motion.duration, 1.0))
    return Passage(np.array(times), np.array(commands), tuple(measurements))


def find_delay(passage: Passage, config: Config, sensor: int = 0) -> SensorDelay:
    """The delay with which the loop's filter predicts what the sensor measures best.

    For each delay the filter goes over the whole motion; what counts is the mean absolute
    innovation in the second half, in standard deviations of the sensor; a measurement that the loop
    refuses counts as the largest. A parabola through the best delay and its neighbours gives the
    minimum; the standard deviation is that of the minima of `BLOCKS` parts of the motion.

    It includes the time from a command to its motion, one control period on most rigs.

    Wrong for a motion that hardly moves, or whose speed never changes: a delay then is an offset.

    Raises:
        CalibrationError: The sensor measured too little, or the best delay is the longest.
    """
    own = [(tick, each) for tick, each in passage.measurements if each.sensor == sensor]
    if len(own) < LEAST_UPDATES:
        what = f"sensor {sensor} measured {len(own)} times"
        raise CalibrationError(what, f"Move for longer: {LEAST_UPDATES} measurements are needed")
    # More often than this says no more of the delay.
    own = own[:: max(1, round(len(own) / (passage.times[-1] - passage.times[0]) / RATE))]
    config = config.replace(**{"measurement.delays": [], "safety.frame_age": 2 * LONGEST})
    found: dict[float, NDArray[np.float64]] = {}

    def misfits(delay: float) -> NDArray[np.float64]:
        if delay not in found:
            found[delay] = _misfits(passage, own, config, delay)
        return found[delay]

    def cost(delay: float) -> float:
        return float(np.mean(misfits(delay)))

    coarse = min(np.arange(0.0, LONGEST + COARSE / 2, COARSE).round(4), key=cost)
    if coarse > LONGEST - COARSE / 2:
        what = f"sensor {sensor}: the delay is {coarse:g} s or longer"
        raise CalibrationError(what, f"Correct the time stamps to within {LONGEST:g} s first")
    near = coarse + np.arange(-4, 5) * FINE
    fine = min(near[near >= 0].round(4), key=cost)
    stencil = [max(fine - FINE, 0.0), fine, fine + FINE]
    blocks = [np.array_split(misfits(round(delay, 4)), BLOCKS) for delay in stencil]
    minima = [
        _minimum(stencil, [float(np.mean(part)) for part in parts])
        for parts in zip(*blocks, strict=True)
    ]
    delay = _minimum(stencil, [cost(round(each, 4)) for each in stencil])
    std = np.hypot(np.std(minima, ddof=1) / np.sqrt(BLOCKS), SYSTEMATIC)
    return SensorDelay(float(delay), float(std), cost(fine) / cost(0.0))


def _misfits(
    passage: Passage, own: list[tuple[int, Measurement]], config: Config, delay: float
) -> NDArray[np.float64]:
    """Mean absolute innovation of each measurement of the second half [standard deviations]."""
    loop = HysteresisReduction(config, compensate=False)
    sensors = Sensors(config, build_kinematics(config))
    waiting, misfits = list(reversed(own)), []
    for tick, (time, command) in enumerate(zip(passage.times, passage.commands, strict=True)):
        loop.step(command, float(time))
        while waiting and waiting[-1][0] <= tick:
            _, measurement = waiting.pop()
            at = measurement.captured_at - delay
            if at < passage.times[0]:
                continue
            report = loop.on_sample(replace(measurement, captured_at=at))
            if tick > len(passage.times) / 2:
                std = np.sqrt(np.diag(sensors.reading(measurement).covariance))
                is_used = report.status in (Status.OK, Status.HELD, Status.PARTIAL)
                misfit = np.nanmean(np.abs(report.innovation / std)) if is_used else np.nan
                misfits.append(misfit)
    found = np.array(misfits)
    found[np.isnan(found)] = np.nanmax(found)
    return found


def _minimum(places: list[float], values: list[float]) -> float:
    """Where the parabola through three points is least; the middle one where it opens downwards."""
    left, middle, right = values
    curvature = left - 2 * middle + right
    if places[0] == places[1] or curvature <= 0:
        return places[1]
    shift = 0.5 * (left - right) / curvature
    return places[1] + float(np.clip(shift, -1, 1)) * (places[2] - places[1])
