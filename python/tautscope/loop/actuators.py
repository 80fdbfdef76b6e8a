"""Motors that are not the degrees of freedom: the map between a command and their positions."""

import inspect
import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config, check_config
from tautscope.config.actuators import scaled_matrix
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.kinematics import Floats
from tautscope.loop.named_class import instance, named_class
from tautscope.loop.rig import OPTIONAL, Rig, Sample
from tautscope.loop.signal_checks import as_numbers, check_signal

Map = Callable[[Floats], ArrayLike]
_LOG = logging.getLogger(__name__)
_ROUNDING, _SECANTS = 1e-9, 20
"""Of limits, over their distance; and how many find where a function of the user's meets them."""


class Actuators:
    """The map of section ``actuators``: motors = matrix q + offsets, or a function of the user's.

    Raises:
        ConfigError: There is no such section; of ``map`` there is no such function or class.
    """

    def __init__(self, config: Config) -> None:
        if config.actuators is None:
            raise ConfigError("actuators", None, "a section with matrix or map")
        self._config, self._count = config.actuators, len(config.dof)
        self._limits = np.array(self._config.limits or [(-np.inf, np.inf)]).T
        self._forward: Map | None = None
        self._backward: Map | None = None
        if self._config.map:
            self._forward, self._backward = _user_map(self._config.map)
            return
        self._matrix = np.array(self._config.matrix)
        self._offsets = np.array(self._config.offsets or [0.0] * len(self._matrix))
        scaled, lengths = scaled_matrix(self._config, config.dof)
        widths = np.array([dof.width_limit for dof in config.dof])
        self._inverse = widths[:, None] * np.linalg.pinv(scaled) / lengths

    def motors(self, command: ArrayLike) -> Floats:
        """Positions (m,) of the motors for a command (n,) [m or rad].

        Raises:
            SignalError: The command is not n finite numbers; the user's function returned something
                other than m.
        """
        values = check_signal("command", command, (self._count,))
        if self._forward is None:
            return np.asarray(self._matrix @ values + self._offsets)
        return _copy("actuators.map", self._forward(values.copy()), len(self._config.limits))

    def dofs(self, motors: ArrayLike) -> Floats | None:
        """Degrees of freedom (n,) of positions (m,) of the motors; None if the map has no way back.

        Of a matrix by least squares, in which each motor counts by how far a width limit moves it.

        Raises:
            SignalError: The positions are not m finite numbers; the user's method returned
                something other than n.
        """
        if self._forward is None:
            values = check_signal("sample.applied", motors, (len(self._matrix),))
            return np.asarray(self._inverse @ (values - self._offsets))
        if self._backward is None:
            return None
        values = _copy("sample.applied", motors)
        return _copy("actuators.map", self._backward(values), self._count)

    def excess(self, command: ArrayLike) -> str:
        """The motors beyond their limits at a command, in words; empty if there are none."""
        positions, config = self.motors(command), self._config
        outside = self._is_outside(positions)
        if not outside.any():
            return ""
        names = config.names or [f"motor_{index + 1}" for index in range(len(positions))]
        units = config.units or [""] * len(positions)
        return ", ".join(
            f"{names[motor]} {positions[motor]:.4g} {units[motor]}".strip()
            for motor in np.flatnonzero(outside)
        )

    def limited(self, start: Floats, command: Floats) -> Floats:
        """As much of the way from a start within the limits to a command as they allow.

        First all degrees of freedom together, then each by itself, so that one at its limit does
        not hold the others.
        """
        reached = self._along(start, command)
        for index in range(self._count):
            target = reached.copy()
            target[index] = command[index]
            reached = self._along(reached, target)
        return reached

    def _is_outside(self, positions: Floats) -> NDArray[np.bool_]:
        low, high = self._limits
        rounding = _ROUNDING * (high - low)
        outside: NDArray[np.bool_] = (positions < low - rounding) | (positions > high + rounding)
        return outside

    def _along(self, start: Floats, end: Floats) -> Floats:
        """One secant is exact for a matrix; a function needs some, each nearer to the start."""
        begin = self.motors(start)
        for _ in range(_SECANTS):
            positions = self.motors(end)
            outside = self._is_outside(positions)
            if not outside.any():
                return end
            moved = (positions - begin)[outside]
            room = (np.clip(positions, *self._limits) - begin)[outside]
            share = np.divide(room, moved, out=np.zeros_like(moved), where=moved != 0.0)
            end = start + float(share.clip(0.0, 1.0).min()) * (end - start)
        return start


def _copy(field: str, values: ArrayLike, count: int = 0) -> Floats:
    """Finite numbers (count,), or any (m,): a user's map may change its argument and its result."""
    array = as_numbers(field, values, "finite numbers")
    return check_signal(field, array, (count or max(1, array.size),)).copy()


def _user_map(name: str) -> tuple[Map, Map | None]:
    field, allowed = "actuators.map", '"module:function" or "module:Class"'
    found = named_class(field, name, allowed)
    if not inspect.isclass(found):
        if not callable(found):
            raise ConfigError(field, name, allowed)
        return found, None
    own = instance(field, name, found)
    if not hasattr(own, "motors"):
        raise ConfigError(field, name, "a class with the method motors(dofs)")
    return own.motors, getattr(own, "dofs", None)


class ActuatedRig:
    """A `Rig` of degrees of freedom made of one that takes and reports motors.

    Where the map has no way back, `Sample.applied` is the command sent, NaN before the first. It
    has `interrupt` and `disable` if the rig has them.
    """

    def __init__(self, rig: Rig, config: Config) -> None:
        self._rig, self.control_period = rig, rig.control_period
        for name in OPTIONAL:
            if hasattr(rig, name):
                setattr(self, name, getattr(rig, name))
        self.actuators = Actuators(config)
        self._sent: Floats | None = None
        self._count = len(config.dof)
        self._is_limited = False

    def reset(self) -> Sample:
        """Reset the rig."""
        self._sent = None
        sample = self._sample(self._rig.reset())
        found = sample.applied
        if np.shape(found) == (self._count,) and np.isfinite(found).all():
            self._sent = None if self.actuators.excess(found) else found
        return sample

    def step(self, command: ArrayLike) -> Sample:
        """Send the motors of a command (n,) [m or rad], limited as `Actuators.limited`.

        Raises:
            SignalError: As `Actuators.motors`; the first command is beyond the limits.
        """
        values = check_signal("command", command, (self._count,))
        excess = self.actuators.excess(values)
        if excess:
            if self._sent is None:
                raise SignalError("command", values.tolist(), f"motors within limits, not {excess}")
            if not self._is_limited:
                _LOG.warning("the command is limited: it needs %s, beyond actuators.limits", excess)
            self._is_limited = True
            values = self.actuators.limited(self._sent, values)
        self._sent = values
        return self._sample(self._rig.step(self.actuators.motors(values)))

    def close(self) -> None:
        """Close the rig."""
        self._rig.close()

    def _sample(self, sample: Sample) -> Sample:
        if not isinstance(sample, Sample):
            return sample  # `check_sample` names it
        found = self.actuators.dofs(sample.applied)
        if found is None:
            found = np.full(self._count, np.nan) if self._sent is None else self._sent
        return replace(sample, applied=found)


def with_actuators(rig: Rig, config: Config) -> Rig:
    """The rig, behind the map of section ``actuators`` if there is one and it is not there yet."""
    if check_config(config).actuators is None or isinstance(rig, ActuatedRig):
        return rig
    return ActuatedRig(rig, config)
