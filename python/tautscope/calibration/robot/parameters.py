"""Parameters of a robot's calibration: where they start, and how far they may be from there."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

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
        FieldError: `keep` names none, and is not "kinematics", of which a robot may have nothing.
    """
    kinds = {type(each) for each in measurements}
    poses = [each for each in measurements if isinstance(each, Pose)]
    sensors = sorted({each.sensor for each in measurements})
    kinematics, found = config.kinematics, []
    is_of_axis = {"insertion", "rotation"} if kinematics.kind == "two_planes" else set()
    for dof in config.dof:
        if dof.name not in is_of_axis or Tip in kinds:
            found.append(Parameter(f"dof.{dof.name}.zero", 0.0, dof.width_limit))
        if len(config.dof) > 1:
            found.append(Parameter(f"dof.{dof.name}.lag", 0.0, LAG, 0.0))
    delays = (*config.measurement.delays, *[0.0] * 4)
    found += [Parameter(f"measurement.delays[{k}]", delays[k], DELAY) for k in sensors]
    if (poses or Points in kinds) and kinematics.kind in {"two_planes", "segments"}:
        for key in ("length", "tip_length"):
            start = getattr(kinematics, key)
            found.append(Parameter(f"kinematics.{key}", start, RELATIVE * start, _SHORTEST))
        if kinematics.kind == "two_planes":
            found.append(Parameter("kinematics.skew", kinematics.skew, ANGLE))
    if poses:
        found += _vector(config, "base_position", LENGTH) + _vector(config, "base_rotation", ANGLE)
    if any(each.orientation is not None for each in poses):
        found += _vector(config, "sensor_rotation", ANGLE)
    names = [each.name for each in found]
    for name in keep:
        if name != "kinematics" and not any(_is_named(each, name) for each in names):
            raise FieldError("--keep", name, ", ".join(names))
    return tuple(each for each in found if not any(_is_named(each.name, name) for name in keep))


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


def _vector(config: Config, key: str, std: float) -> list[Parameter]:
    values = np.asarray(getattr(config.kinematics, key)).tolist()
    return [Parameter(f"kinematics.{key}[{k}]", value, std) for k, value in enumerate(values)]
