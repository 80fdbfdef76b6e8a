"""Checks of what the sensors of a rig measured while it was held."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.errors import TautscopeError
from tautscope.hardware.doctor.check_result import CheckResult, from_error, result
from tautscope.loop.kinematics import build_kinematics
from tautscope.loop.measurement import Measurement, Reading, Sensors, raw_values
from tautscope.loop.rig import Sample

Floats = NDArray[np.float64]
_REPEATED = 0.5
"""Share of values that repeat the last one above which a sensor counts as repeating."""
_DETERMINED = 0.5
"""Standard deviation up to which a degree of freedom counts as determined [width_limit]."""


@dataclass(frozen=True, eq=False)
class _Arrival:
    arrived_at: float
    measurement: Measurement
    reading: Reading


def check_sensors(samples: Sequence[Sample], config: Config) -> Iterator[CheckResult]:
    """Check each sensor of a robot with [[dof]], and that together they determine its state."""
    try:
        sensors = Sensors(config, build_kinematics(config))
        arrivals = [
            _Arrival(sample.time, each, sensors.reading(each))
            for sample in samples
            for each in sample.measurements
        ]
        # Once each: a model of the user's may be wrong only when it is called.
        at = np.array(samples[-1].applied, dtype=np.float64)
        models = {each.measurement.sensor: each.reading.model(at) for each in arrivals}
    except TautscopeError as error:
        yield from_error("rig", "sensors", error)
        return
    if not arrivals:
        seconds = samples[-1].time - samples[0].time
        todo = "Sample.measurement is a Tip, Pose or Points, or several in a tuple"
        found = f"nothing was measured in {seconds:.3g} s"
        yield CheckResult("rig", "sensors", "missing", found, todo)
        return
    for sensor in sorted(models):
        own = [each for each in arrivals if each.measurement.sensor == sensor]
        yield _check_sensor(sensor, own, config)
    yield _check_determined(arrivals, at, config)
    if len(config.measurement.delays) <= max(models):
        todo = "tautscope calibrate latency --rig measures it: an unknown delay looks like slack"
        yield CheckResult("rig", "measurement.delays", "note", "not measured yet", todo)


def _check_sensor(sensor: int, arrivals: list[_Arrival], config: Config) -> CheckResult:
    what = f"sensor {sensor}, {type(arrivals[0].measurement).__name__}"
    times = np.array([each.measurement.captured_at for each in arrivals])
    ages = np.array([each.arrived_at for each in arrivals]) - times
    values = [raw_values(each.measurement) for each in arrivals]
    repeats = [np.array_equal(a, b, equal_nan=True) for a, b in itertools.pairwise(values)]
    gap = float(np.diff(times).max()) if len(times) > 1 else np.inf
    rate = (len(times) - 1) / (times[-1] - times[0]) if times[-1] > times[0] else 0.0
    lost = float(np.mean([np.isnan(each).mean() for each in values]))
    delays, safety = config.measurement.delays, config.safety
    delay = delays[sensor] if sensor < len(delays) else 0.0
    found = (
        f"{rate:.3g} per second, stamped {1e3 * np.median(ages):.3g} ms before they arrive"
        f"{f', {delay:g} s less by measurement.delays' if delay else ''}"
        f"{f', {lost:.0%} NaN' if lost else ''}"
    )
    data = {"rate": float(rate), "age": float(np.median(ages)), "nan": lost, "delay": delay}
    missing, note = "", ""
    far = _implausible(arrivals, config)
    if ages.min() < -config.control.period:
        missing = "captured_at is on the clock of Sample.time, and not after it"
    elif ages.max() + delay > safety.frame_age:
        missing = f"Older ones than safety.frame_age, {safety.frame_age:g} s, are refused: raise it"
    elif gap > safety.frame_gap:
        missing = (
            f"After {gap:.2g} s without one the sensor counts as silent: raise safety.frame_gap, "
            f"{safety.frame_gap:g} s"
        )
    elif far:
        missing = f"{far}: use m and rad, and the frame of the kinematics"
    elif (np.diff(times) <= 0).any():
        note = "Some are delivered again: give each measurement once"
    elif repeats and np.mean(repeats) > _REPEATED:
        found += f", {np.mean(repeats):.0%} repeat the last value"
        note = "A sensor with noise does not: give a measurement only when there is a new one"
    return result("rig", what, found, data, missing=missing, note=note)


def _implausible(arrivals: list[_Arrival], config: Config) -> str:
    """What was measured farther from where the ranges allow than they are wide, in words."""
    ranges = [dof.range for dof in config.dof if dof.range is not None]
    if len(ranges) < len(config.dof):
        return ""
    reading = arrivals[-1].reading
    size = raw_values(arrivals[-1].measurement).size  # without the orientation, which has no range
    states = (*itertools.product(*ranges), np.mean(ranges, axis=1))
    seen = [reading.model(np.array(q)) for q in states]
    places = np.array([each[0][:size] for each in seen if each is not None])
    if not len(places):
        return ""
    low, high = places.min(axis=0), places.max(axis=0)
    margin = max(float(np.linalg.norm(high - low)), 1e-9)
    values = reading.values[:size]
    beyond = np.maximum(low - values, values - high) > margin
    if not beyond.any():
        return ""
    index = int(np.argmax(beyond))
    allowed = f"{low[index]:.4g} to {high[index]:.4g}"
    return f"Value {index + 1} is {values[index]:.4g}, and the ranges give {allowed}"


def _check_determined(arrivals: list[_Arrival], at: Floats, config: Config) -> CheckResult:
    """One measurement of each sensor: the standard deviation of each degree of freedom."""
    widths = np.array([dof.width_limit for dof in config.dof])
    information = 1e-6 * np.eye(len(widths))
    for each in {one.measurement.sensor: one for one in arrivals}.values():
        model = each.reading.model(at)
        known = np.isfinite(each.reading.values)
        if model is None:
            continue
        rows = model[1][known] * widths
        weight = np.linalg.inv(each.reading.covariance[np.ix_(known, known)])
        information += rows.T @ weight @ rows
    std = np.sqrt(np.diag(np.linalg.inv(information)))
    names = [dof.name for dof, one in zip(config.dof, std, strict=True) if one > _DETERMINED]
    if names:
        todo = "Add a sensor of it, or correct [kinematics]: its slack cannot be found"
        found = f"no sensor determines {' or '.join(names)}"
        return CheckResult("rig", "degrees of freedom", "missing", found, todo)
    found = ", ".join(
        f"{dof.name} to {dof.display_scale * one * dof.width_limit:.2g} {dof.display_unit}"
        for dof, one in zip(config.dof, std, strict=True)
    )
    return CheckResult("rig", "degrees of freedom", "ok", f"one measurement of each: {found}")
