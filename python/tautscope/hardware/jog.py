"""A slow motion of one motor out and back, to check signs and distances of a rig."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config, DrivesConfig
from tautscope.dof import Dof, Motor, NamedDof, unit
from tautscope.errors import STOPPED, FieldError, SignalError, TautscopeError
from tautscope.hardware.drives import open_drives
from tautscope.hardware.scale import Scale
from tautscope.hardware.signals import exit_on_signals
from tautscope.loop.measurement import Measurement, Pose, Tip, raw_values
from tautscope.loop.rig import Rig, check_sample

DURATION = 4.0
"""Duration of the motion out and back [s]."""
LARGEST = (2e-3, 0.2, 0.2)
"""Largest distance of a first test of the article's DOFs [m or rad]."""
_RESTS = ((0.0, 0.1), (0.45, 0.55), (0.9, 1.0))
"""Parts of the motion in which it rests: at its start, out and back [share of it]."""


def check_distance(dof: NamedDof, distance: float) -> None:
    """Check the distance of a jog [m or rad].

    Raises:
        FieldError: It is 0, not finite, or beyond `LARGEST`, or ``width_limit`` of an entry of
            [[dof]], beyond which the tip moves for sure.
    """
    largest = LARGEST[dof] if isinstance(dof, Dof) else getattr(dof, "width_limit", 0.0)
    if not 0 < abs(distance) <= largest:
        raise FieldError("distance", distance, f"at most {largest:g} {unit(dof)}, and not 0")


def jog(
    config: DrivesConfig, dof: Motor, distance: float, *, reset_faults: bool = False
) -> tuple[float, float]:
    """Move a motor along raised cosines by `distance` [m or rad] and back, with `_RESTS`.

    THE MOTOR MOVES. It is quick-stopped at the end, and on every error. Faults of the drives are
    reset first if `reset_faults`: find their cause before.

    Returns:
        Largest displacement and displacement at the end, as the drive measured them [m or rad].

    Raises:
        FieldError: The distance is not allowed, see `check_distance`, or leaves the travel.
        DriveError: A drive is missing, differs from its configuration, or failed.
    """
    check_distance(dof, distance)
    with exit_on_signals(), open_drives(config) as drives:
        begin = drives.start(reset_faults=reset_faults)
        if not Scale(config[dof], dof).is_inside(begin[dof] + distance):
            at = f"{dof.label} is at {begin[dof]:.4g} {unit(dof)}"
            lower, upper = config[dof].travel
            allowed = f"within {dof.key}.travel, {lower:g} to {upper:g} {unit(dof)}: {at}"
            raise FieldError("distance", distance, allowed)
        commands = [command for _, command in _out_and_back(begin, dof, distance, config.cycle)]
        try:
            applied = [begin, *drives.follow(commands)]
        except TautscopeError as error:
            error.exit_status = STOPPED
            raise
    moved = np.array(applied)[:, dof] - begin[dof]
    return float(moved[np.abs(moved).argmax()]), float(moved[-1])


@dataclass(frozen=True, slots=True)
class SensorMotion:
    """What a sensor measured of a jog: means while the rig rests out and back, less the start.

    Attributes:
        sensor: Its number.
        what: "tip" of the degree of freedom itself, "position" or "points" as distances.
        moved: Out [m, rad or px]; without a sign of a distance.
        ended_at: Back.
        unit: In which it is shown.
        scale: Factor to this unit.
    """

    sensor: int
    what: str
    moved: float
    ended_at: float
    unit: str
    scale: float


def jog_rig(
    rig: Rig, config: Config, index: int, distance: float
) -> tuple[float, float, list[SensorMotion]]:
    """Move a degree of freedom of a rig by `distance` [m or rad] and back, with `_RESTS`.

    THE MOTORS MOVE: first `Rig.reset`, then the one from where it is. The caller closes the rig.

    Returns:
        Largest displacement and displacement at the end, as the rig reports them, and what each
        sensor measured.

    Raises:
        FieldError: The distance is not allowed, or leaves the range.
        SignalError: A sample is not as `tautscope.Sample` says.
    """
    dof = config.dof[index]
    check_distance(dof, distance)
    with exit_on_signals():
        begin = np.array(check_sample(rig.reset(), config).applied, dtype=np.float64)
        if not np.isfinite(begin).all():
            allowed = "where the motors are; of actuators.map a class with dofs(motors)"
            raise SignalError("sample.applied", begin.tolist(), allowed)
        low, high = dof.range or (-np.inf, np.inf)
        if not low <= begin[index] + distance <= high:
            at = f"{dof.name} is at {begin[index]:.4g} {unit(dof)}"
            allowed = f"within range {[low, high]} {unit(dof)}: {at}"
            raise FieldError("distance", distance, allowed)
        applied: list[float] = []
        measured: dict[int, list[tuple[float, Measurement]]] = {}
        for share, command in _out_and_back(begin, index, distance, config.control.period):
            sample = check_sample(rig.step(command), config)
            applied.append(sample.applied[index] - begin[index])
            for each in sample.measurements:
                measured.setdefault(each.sensor, []).append((share, each))
    largest = max(applied, key=abs)
    seen = [_seen(sensor, own, config, index) for sensor, own in sorted(measured.items())]
    return float(largest), float(applied[-1]), [each for each in seen if each is not None]


def _seen(
    sensor: int, own: list[tuple[float, Measurement]], config: Config, index: int
) -> SensorMotion | None:
    """What a sensor measured; None if it did not in each of `_RESTS`."""
    means: list[NDArray[np.float64]] = []
    for begin, end in _RESTS:
        near = [raw_values(each) for time, each in own if begin <= time <= end]
        if not near:
            return None
        means.append(np.mean(near, axis=0))
    start, out, back = means
    first = own[0][1]
    if isinstance(first, Tip):
        dof = config.dof[index]
        moved, ended = (float(each[index] - start[index]) for each in (out, back))
        if np.isnan(moved + ended):
            return None
        return SensorMotion(sensor, "tip", moved, ended, dof.display_unit, dof.display_scale)
    moved, ended = (float(np.sqrt(np.nansum((each - start) ** 2))) for each in (out, back))
    if isinstance(first, Pose):
        return SensorMotion(sensor, "position", moved, ended, "mm", 1e3)
    return SensorMotion(sensor, "points", moved, ended, "px", 1.0)


def _out_and_back(
    begin: NDArray[np.float64], index: int, distance: float, period: float
) -> Iterator[tuple[float, NDArray[np.float64]]]:
    """Share of the motion and command: raised cosines to a distance and back, with `_RESTS`."""
    steps = round(DURATION / period)
    for step in range(steps + 1):
        phase = np.interp(step / steps, np.ravel(_RESTS), (0.0, 0.0, 0.5, 0.5, 1.0, 1.0))
        command = begin.copy()
        command[index] += distance * (1 - np.cos(2 * np.pi * phase)) / 2
        yield step / steps, command
