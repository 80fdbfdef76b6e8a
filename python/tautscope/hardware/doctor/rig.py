"""Checks of a rig of one's own, which is reset and then held where it is."""

import itertools
import math
import time
from collections.abc import Iterator

import numpy as np

from tautscope.config import Config
from tautscope.dof import display_text
from tautscope.errors import SignalError, TautscopeError
from tautscope.hardware.doctor.check_result import CheckResult, from_error, result
from tautscope.hardware.doctor.sensors import check_sensors
from tautscope.loop.actuators import ActuatedRig
from tautscope.loop.rig import Rig, Sample, check_sample

HOLD = 3.0
"""How long the rig is held [s, its clock]."""
_TOLERANCE = 0.05
"""Of periods, over the period; and of positions beyond a range, over the range."""


def check_rig(rig: Rig, config: Config) -> Iterator[CheckResult]:
    """Check what a rig returns while it is held for `HOLD`.

    THE MOTORS MAY MOVE: `Rig.reset` brings them to their start. Then they are commanded to where
    they are.
    """
    try:
        samples, durations = _hold(rig, config)
    except TautscopeError as error:
        yield from_error("rig", "samples", error)
        return
    yield _check_clock(samples, config.control.period)
    yield _check_pace(durations, config.control.period)
    yield _check_applied(samples, config)
    if isinstance(rig, ActuatedRig):
        yield _check_actuators(rig, config)
    yield from check_sensors(samples, config)


def _hold(rig: Rig, config: Config) -> tuple[list[Sample], list[float]]:
    """The samples, and how long each step took [s, the computer's clock]."""
    samples, durations = [check_sample(rig.reset(), config)], []
    at = np.array(samples[0].applied, dtype=np.float64)
    if not np.isfinite(at).all():
        allowed = "where the motors are, to hold them; of actuators.map a class with dofs(motors)"
        raise SignalError("sample.applied", at.tolist(), allowed)
    for _ in range(round(HOLD / config.control.period)):
        began = time.monotonic()
        samples.append(check_sample(rig.step(at), config))
        durations.append(time.monotonic() - began)
    return samples, durations


def _check_clock(samples: list[Sample], period: float) -> CheckResult:
    steps = np.diff([sample.time for sample in samples])
    median, least = float(np.median(steps)), float(steps.min())
    found = f"{1e3 * median:.4g} ms per step, {1e3 * steps.max():.4g} ms at most"
    data = {"median": median, "largest": float(steps.max()), "least": least}
    todo = (
        f"Sample.time is in s and advances by control_period, {1e3 * period:g} ms, with every step"
    )
    is_wrong = least <= 0 or abs(median / period - 1) > _TOLERANCE
    return result("rig", "clock", found, data, missing=todo if is_wrong else "")


def _check_pace(durations: list[float], period: float) -> CheckResult:
    share = sum(durations) / len(durations) / period
    found = (
        f"a step takes {1e3 * sum(durations) / len(durations):.3g} ms of the computer's clock, "
        f"{1e3 * max(durations):.3g} ms at most"
    )
    data = {"share_of_period": share, "largest": max(durations)}
    todo = "Right for a simulation; of motors, step() returns after one control_period"
    return result("rig", "pace", found, data, note=todo if abs(share - 1) > _TOLERANCE else "")


def _check_applied(samples: list[Sample], config: Config) -> CheckResult:
    applied = np.array([sample.applied for sample in samples], dtype=np.float64)
    found = f"at {display_text(applied[-1], config.dofs)}"
    data = {"applied": np.nan_to_num(applied[-1]).tolist()}
    for dof, values in zip(config.dof, applied.T, strict=False):
        low, high = dof.range or (-math.inf, math.inf)
        margin = _TOLERANCE * (high - low) if dof.range else 0.0
        if (
            not np.isfinite(values).all()
            or values.min() < low - margin
            or values.max() > high + margin
        ):
            todo = f"Sample.applied is in {dof.unit}, in the order of [[dof]], within its range"
            return result("rig", f"applied {dof.name}", found, data, missing=todo)
        if np.ptp(values) > dof.width_limit / 4:
            moved = f"{found}; moved by {dof.display_scale * np.ptp(values):.3g} {dof.display_unit}"
            todo = "The command was the position after reset(): check sign, unit and order"
            return result("rig", f"applied {dof.name}", moved, data, missing=todo)
    return result("rig", "applied", found, data)


def _check_actuators(rig: ActuatedRig, config: Config) -> CheckResult:
    ranges = [dof.range for dof in config.dof if dof.range is not None]
    if len(ranges) < len(config.dof):
        todo = "Give each [[dof]] a range: whether the limits allow it is checked"
        return CheckResult("rig", "actuators", "note", "limits not compared with ranges", todo)
    for corner in itertools.product(*ranges):
        excess = rig.actuators.excess(corner)
        if excess:
            found = f"{display_text(corner, config.dofs)} needs {excess}"
            todo = "Correct range, matrix or limits: such commands are limited"
            return CheckResult("rig", "actuators", "note", found, todo)
    return CheckResult("rig", "actuators", "ok", "the limits allow all of the ranges")
