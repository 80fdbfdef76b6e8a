"""Parameters of a robot's calibration: priors, and what they change in a configuration."""

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any

import numpy as np

from tautscope._core import MOST_SENSORS
from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.loop.measurement import Measurement, Points, Pose, Tip

LENGTH, ANGLE, DELAY, LAG = 0.05, 0.5, 1.0, 0.03
"""Standard deviations of priors: of positions [m], angles [rad], delays and lags [s]."""
RELATIVE = 0.3
"""Of lengths, as a share of them."""
_SHORTEST = 1e-4
"""Shortest length [m]."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter: a key of the configuration, ``dof.NAME.zero`` or ``dof.NAME.lag``."""

    name: str
    start: float
    std: float
    low: float = -math.inf


def fitted(
    config: Config, measurements: Iterable[Measurement], keep: Sequence[str]
) -> tuple[Parameter, ...]:
    """The parameters that a configuration and its sensors have, less those to keep.

    The zeros of an insertion along and a rotation about the axis of "two_planes" are those of the
    motors: they could not be told from the pose of the base.

    Raises:
        FieldError: As `check_keep`.
    """
    check_keep(config, keep)
    kinds: set[type] = {type(each) for each in measurements}
    sensors = sorted({each.sensor for each in measurements})
    is_turned = any(each.orientation is not None for each in measurements if isinstance(each, Pose))
    found = _all(config, kinds, sensors, is_turned=is_turned)
    return tuple(each for each in found if not any(_is_named(each.name, name) for name in keep))


def check_keep(config: Config, keep: Sequence[str]) -> None:
    """Check names to keep: those of parameters that some sensor of the robot could have.

    Raises:
        FieldError: A name is none of them, nor "kinematics", of which a robot may have nothing.
    """
    found = _all(config, {Tip, Pose, Points}, range(MOST_SENSORS), is_turned=True)
    names = [each.name for each in found]
    for name in keep:
        if name != "kinematics" and not any(_is_named(each, name) for each in names):
            raise FieldError("--keep", name, ", ".join(names))


def _all(
    config: Config, kinds: Set[type], sensors: Iterable[int], *, is_turned: bool
) -> list[Parameter]:
    """The parameters with sensors of some kinds, and poses with an orientation or without."""
    kinematics, found = config.kinematics, []
    is_of_axis = {"insertion", "rotation"} if kinematics.kind == "two_planes" else set()
    for dof in config.dof:
        if dof.name not in is_of_axis or Tip in kinds:
            found.append(Parameter(f"dof.{dof.name}.zero", 0.0, dof.width_limit))
        if len(config.dof) > 1:
            found.append(Parameter(f"dof.{dof.name}.lag", 0.0, LAG, 0.0))
    delays = (*config.measurement.delays, *[0.0] * 4)
    found += [Parameter(f"measurement.delays[{k}]", delays[k], DELAY) for k in sensors]
    if (Pose in kinds or Points in kinds) and kinematics.kind in {"two_planes", "segments"}:
        for key in ("length", "tip_length"):
            start = getattr(kinematics, key)
            found.append(Parameter(f"kinematics.{key}", start, RELATIVE * start, _SHORTEST))
        if kinematics.kind == "two_planes":
            found.append(Parameter("kinematics.skew", kinematics.skew, ANGLE))
    if Pose in kinds:
        found += _vector(config, "base_position", LENGTH) + _vector(config, "base_rotation", ANGLE)
    if is_turned:
        found += _vector(config, "sensor_rotation", ANGLE)
    return found


def _is_named(name: str, by: str) -> bool:
    """Whether a name is this one or an item of it."""
    return name == by or name.startswith((f"{by}[", f"{by}."))


def with_values(config: Config, values: Mapping[str, float]) -> dict[str, Any]:
    """Changes of a configuration by values of parameters that are keys of it."""
    changes: dict[str, Any] = {}
    for name, value in values.items():
        path, _, index = name.rstrip("]").partition("[")
        section, key, *others = path.split(".")
        if others:  # of a degree of freedom
            continue
        if not index:
            changes[path] = value
            continue
        items = changes.setdefault(path, list(getattr(getattr(config, section), key)))
        items += [0.0] * (int(index) + 1 - len(items))
        items[int(index)] = max(value, 0.0) if section == "measurement" else value
    return changes


def motor_map(
    config: Config, values: Mapping[str, float], std: Mapping[str, float]
) -> tuple[dict[str, Any], dict[str, float]]:
    """Changes of section ``actuators`` with which gains are 1 and zeros 0, and their deviations.

    The tip is at zero + gain c, and the motors at M c + o; for a tip at c' they have to be at

        M diag(1 / gain) c' + o - M (zero / gain).

    A rig without the section takes the command: M is the identity. With a function of the user's in
    place of M there are no changes.
    """
    actuators, names = config.actuators, [dof.name for dof in config.dof]
    changes: dict[str, Any] = {}
    if actuators is None:
        matrix, offsets = np.eye(len(names)), np.zeros(len(names))
        units = [str(dof.unit) for dof in config.dof]
        changes = {"actuators.names": names, "actuators.units": units}
    elif actuators.map:
        return {}, {}
    else:
        matrix = np.array(actuators.matrix)
        offsets = np.array(actuators.offsets or [0.0] * len(matrix))
    (gain, zero), (gain_std, zero_std) = (
        np.array([[of.get(f"dof.{name}.{key}", 0.0) for name in names] for key in ("gain", "zero")])
        for of in (values, std)
    )
    scaled = matrix / gain + 0.0  # no -0.0
    by_gain = np.abs(scaled) * gain_std / np.abs(gain)
    by_offset = np.hypot(scaled @ np.diag(zero_std), by_gain * zero)
    changes["actuators.matrix"] = scaled.tolist()
    changes["actuators.offsets"] = (offsets - scaled @ zero).tolist()
    stds = {
        f"actuators.matrix[{row}][{column}]": float(each)
        for (row, column), each in np.ndenumerate(by_gain)
    }
    total = np.sqrt(np.sum(by_offset**2, axis=1))
    return changes, stds | {f"actuators.offsets[{k}]": float(each) for k, each in enumerate(total)}


def _vector(config: Config, key: str, std: float) -> list[Parameter]:
    values = np.asarray(getattr(config.kinematics, key)).tolist()
    return [Parameter(f"kinematics.{key}[{k}]", value, std) for k, value in enumerate(values)]
