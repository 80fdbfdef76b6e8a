"""Motors of a robot whose motors are not its degrees of freedom."""

from collections.abc import Sequence
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from tautscope.config.axes import DofEntry, Name
from tautscope.config.drives import DrivesConfig
from tautscope.config.fields import LIMITS
from tautscope.config.safety import SafetyConfig
from tautscope.config.section import Section, require
from tautscope.dof import Dof
from tautscope.errors import ConfigError

_MOST_REACHES = 10.0
"""Largest travel of a motor over the farthest that commands move it: less than degrees in a rad."""


class ActuatorsConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Motors of a robot with [[dof]] that are not its degrees of freedom.

    Antagonistic pairs, coupled tendons, gears and signs: motor positions = matrix times command +
    offsets. A rig then takes and reports motor positions, else the command.
    """

    matrix: tuple[tuple[float, ...], ...] = ()
    """A row per motor: its motion over that of each degree of freedom."""
    offsets: tuple[float, ...] = ()
    """Position of each motor at command 0; else 0."""
    limits: tuple[tuple[float, float], ...] = ()
    """Least and largest position of each motor; a command beyond is followed as far as they
    allow."""
    names: tuple[Name, ...] = ()
    """Names of the motors in messages; else motor_1, motor_2, ..."""
    units: tuple[str, ...] = ()
    """Their units in messages, as mm, rad or counts."""
    map: str = ""
    """In place of matrix and offsets: "module:function" of yours from command to motors, or
    "module:Class" with motors(dofs) and, if motors are reported, dofs(motors)."""

    def _check(self) -> None:
        found = "both" if self.map else "neither"
        require(bool(self.matrix) != bool(self.map), "matrix", found, "either matrix or map")
        allowed = "no offsets with map: it has its own"
        require(not (self.map and self.offsets), "offsets", self.offsets, allowed)
        given = {name: getattr(self, name) for name in ("offsets", "limits", "names", "units")}
        count = len(self.matrix) or max(map(len, given.values()))
        for key, values in given.items():
            is_whole = not values or len(values) == count
            require(is_whole, key, values, f"{count} values, one per motor")
        for index, limits in enumerate(self.limits):
            require(limits[0] < limits[1], f"limits[{index}]", limits, LIMITS)
        for index, name in enumerate(self.names):
            is_new = name not in self.names[:index]
            require(is_new, f"names[{index}]", name, "a name used once")


def check_motors(
    drives: DrivesConfig,
    actuators: ActuatorsConfig | None,
    dofs: Sequence[DofEntry],
    safety: SafetyConfig,
) -> None:
    """Check that section ``drives`` has the motors of the robot; keys from the root."""
    if bool(drives.motors) != bool(dofs):
        found = list(drives.motors) or [motor.label for motor in drives.all_motors]
        allowed = "[drives.motors.NAME] with [[dof]], else insertion, rotation and bending"
        raise ConfigError("drives", found, allowed)
    if not dofs:
        for dof, limits in zip(Dof, safety.command_travel, strict=True):
            _check_travel(dof.key, drives[dof].travel, max(map(abs, limits)))
        return
    reach = np.array([max(map(abs, dof.travel)) for dof in dofs])
    if actuators is None:
        names, units = [dof.name for dof in dofs], [str(dof.unit) for dof in dofs]
    elif len(actuators.names) == len(actuators.units) > 0:
        names, units = list(actuators.names), list(actuators.units)
        matrix = np.abs(actuators.matrix)
        reach = matrix @ reach if actuators.matrix else np.full(len(names), np.inf)
        reach += np.abs(actuators.offsets or 0.0)
    else:
        allowed = "names and units of the motors in [drives.motors]"
        raise ConfigError("actuators.names", list(actuators.names), allowed)
    if list(drives.motors) != names:
        raise ConfigError("drives.motors", list(drives.motors), f"in this order {names}")
    for (name, motor), unit, farthest in zip(drives.motors.items(), units, reach, strict=True):
        if motor.unit != unit:
            raise ConfigError(f"drives.motors.{name}.unit", motor.unit, repr(unit))
        _check_travel(f"drives.motors.{name}", motor.travel, farthest)


def _check_travel(key: str, travel: tuple[float, float], reach: float) -> None:
    """Check that a motor's travel is of the order of the farthest that commands move it."""
    most = _MOST_REACHES * reach
    allowed = f"within -{most:.3g} to {most:.3g}: commands move it by {reach:.3g}"
    require(max(map(abs, travel)) <= most, f"{key}.travel", travel, allowed)


def check_actuators(actuators: ActuatorsConfig, dofs: Sequence[DofEntry]) -> None:
    """Check section ``actuators`` with [[dof]]; keys from the root."""
    if not dofs:
        raise ConfigError("actuators", "no [[dof]]", "[[dof]]: the article's are its motors")
    for index, row in enumerate(actuators.matrix):
        if len(row) != len(dofs):
            allowed = f"{len(dofs)} numbers, one per degree of freedom"
            raise ConfigError(f"actuators.matrix[{index}]", row, allowed)
    if not actuators.matrix:
        return
    scaled, _ = scaled_matrix(actuators, dofs)
    _, sizes, directions = np.linalg.svd(scaled, full_matrices=True)
    rank = int(np.sum(sizes > 1e-9))
    if rank < len(dofs):
        moved = np.abs(directions[rank:]).max(axis=0) > 1e-6
        names = " and ".join(dof.name for dof in compress(dofs, moved))
        allowed = f"rank {len(dofs)}: the motors do not determine {names}"
        raise ConfigError("actuators.matrix", f"rank {rank}", allowed)


def scaled_matrix(
    actuators: ActuatorsConfig, dofs: Sequence[DofEntry]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The matrix (m, n) in units of width_limit, each row of length 1, and those lengths (m,).

    Units differ from motor to motor; neither the rank nor a least-squares solution may depend on
    them.
    """
    matrix = np.array(actuators.matrix) * [dof.width_limit for dof in dofs]
    lengths = np.linalg.norm(matrix, axis=1)
    lengths[lengths == 0.0] = 1.0
    return matrix / lengths[:, None], lengths
