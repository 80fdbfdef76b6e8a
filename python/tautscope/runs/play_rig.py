"""A simulated robot of plays, to try a configuration before the motors move."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config, check_config
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.actuators import Actuators
from tautscope.loop.kinematics import build_kinematics, rotation_matrix
from tautscope.loop.measurement import Measurement, Pose, Tip
from tautscope.loop.rig import Sample
from tautscope.loop.signal_checks import as_numbers, check_signal, check_time

EVERY = 5
"""Control periods from one measurement to the next."""


class PlayRig:
    """A robot with [[dof]] whose tip follows its motors through plays; implements `Rig`.

    Of each degree of freedom the tip is the mean of one or several plays, Eq. (1), of the command:

        q(t) = zero + gain mean_k min(max(p_k(t-1), c(t) - w_k / 2), c(t) + w_k / 2)

    With section ``actuators`` it takes and reports motors. `measure` is what its sensors see;
    override it for yours.

    Args:
        config: With [[dof]].
        slack: w (n,), (n, k) or one for all [m or rad]; by default half of each width limit.
        gains: (n,) or one for all.
        zeros: (n,) [m or rad] or one for all.
        delay: Time from a measurement to its arrival, up to a control period more [s].
        seed: Of the noise; a generator continues after a `reset`.

    Attributes:
        ticks: Control periods since `reset`.
        kinematics: Of the configuration; None where each degree of freedom is measured.

    Wrong for real robots in that loops of one play have corners, nothing bends by itself, and no
    degree of freedom moves another.

    Raises:
        ConfigError: The configuration has no [[dof]].
        SignalError: An argument is not as described, or a slack below 0.
    """

    def __init__(
        self,
        config: Config,
        slack: ArrayLike | None = None,
        *,
        gains: ArrayLike = 1.0,
        zeros: ArrayLike = 0.0,
        delay: float = 0.0,
        seed: int | np.random.Generator = 0,
    ) -> None:
        if not check_config(config).dof:
            raise ConfigError("dof", "none", "degrees of freedom: [[dof]]")
        self.config, self.control_period = config, config.control.period
        self._limits = np.array([dof.width_limit for dof in config.dof])
        count = len(self._limits)
        widths = self._limits / 2 if slack is None else _of_each("slack", slack, count, most=2)
        if (widths < 0.0).any():
            raise SignalError("slack", widths.tolist(), "widths of at least 0 m or rad")
        self._half = widths.reshape(count, -1) / 2
        self._gains, self._zeros = _of_each("gains", gains, count), _of_each("zeros", zeros, count)
        self._delay = check_time("delay", delay)
        self._actuators = None if config.actuators is None else Actuators(config)
        self.kinematics = build_kinematics(config)
        self._is_apart = [dof.name in config.kinematics.without for dof in config.dof]
        self._seed = seed
        self._plays: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {', '.join(dof.name for dof in self.config.dof)}>"

    def reset(self) -> Sample:
        """At command 0, all plays at rest in their middle."""
        self.ticks, self.rng = 0, np.random.default_rng(self._seed)
        self._plays, self._under_way = np.zeros_like(self._half), list[tuple[float, Measurement]]()
        rest = np.zeros(len(self._limits))
        return self.step(rest if self._actuators is None else self._actuators.motors(rest))

    def step(self, command: ArrayLike) -> Sample:
        """Move to a command (n,) [m or rad], or positions (m,) of the motors.

        Raises:
            SignalError: These are not as many finite numbers, or there was no `reset`.
        """
        if self._plays is None:
            raise SignalError("rig", "a command before reset()", "a rig after reset()")
        if self._actuators is None:
            applied = motors = check_signal("command", command, (len(self._half),))
        else:
            applied = as_numbers("command", command, "positions of the motors")
            found = self._actuators.dofs(applied)
            if found is None:
                raise SignalError("actuators.map", "no way back", "a class with dofs(motors)")
            motors = found
        motors = motors[:, None]
        self._plays = np.clip(self._plays, motors - self._half, motors + self._half)
        tip = self._zeros + self._gains * self._plays.mean(axis=1)
        self.ticks += 1
        time = self.ticks * self.control_period
        self._under_way += [(time, each) for each in self.measure(tip, time)]
        arrived = [each for at, each in self._under_way if at <= time - self._delay]
        self._under_way = self._under_way[len(arrived) :]
        return Sample(time, applied, true_state=tip, measurement=tuple(arrived))

    def close(self) -> None:
        """Do nothing: nothing moves."""

    def measure(self, tip: NDArray[np.float64], time: float) -> Iterable[Measurement]:
        """What sensors see of a tip q (n,) at a time [s], in every fifth control period.

        With a kinematics the pose of the tip, and as sensor 1 what does not move it; else each
        degree of freedom. The noise is that of section ``measurement``.
        """
        if self.ticks % EVERY:
            return
        noise, settings = self.rng.normal, self.config.measurement
        values = tip + noise(0.0, settings.tip_deviation * self._limits)
        if self.kinematics is None:
            yield Tip(values, time)
            return
        position, rotation = self.kinematics.tip(tip)
        turned = rotation_matrix(noise(0.0, settings.orientation_deviation, 3))
        yield Pose(position + noise(0.0, settings.position_deviation, 3), time, rotation @ turned)
        if any(self._is_apart):
            yield Tip(np.where(self._is_apart, values, np.nan), time, sensor=1)


def _of_each(field: str, values: ArrayLike, count: int, *, most: int = 1) -> NDArray[np.float64]:
    """Finite numbers (count,), of at most two dimensions (count, k); or one for all."""
    array = as_numbers(field, values, f"{count} finite numbers")
    if array.ndim == 0:
        array = np.full(count, array)
    return check_signal(field, array, (count, *(max(k, 1) for k in array.shape[1:most])))
