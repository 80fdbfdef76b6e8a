"""What a sensor measures of the tip, as values, covariance and a model of the sensor."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope._core import MOST_VALUES
from tautscope.config import Config
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.kinematics import (
    STEP,
    Floats,
    Kinematics,
    Predict,
    jacobian_by_differences,
    rotation_vector,
)
from tautscope.loop.signal_checks import (
    as_floats,
    as_numbers,
    check_covariance,
    check_numbers,
    check_result,
)

Model = Callable[[Floats], tuple[Floats, Floats] | None]
"""State (n,) to the values (m,) that would be measured and their derivatives (m, n)."""
_UNIT_LENGTH = 1e-3
"""How far a quaternion or a rotation matrix may be from one by rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Tip:
    """The tip measured degree by degree: values (n,) [m or rad], NaN for what was not measured."""

    values: ArrayLike
    captured_at: float
    covariance: ArrayLike | None = None
    sensor: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Position (3,) [m] and, if measured, orientation of the tip, by an EM tracker for example.

    `orientation` is a rotation matrix (3, 3) or a quaternion (4,) x, y, z, w; the covariance is
    (3, 3) or (6, 6), position first, then the rotation about the sensor's axes.
    """

    position: ArrayLike
    captured_at: float
    orientation: ArrayLike | None = None
    covariance: ArrayLike | None = None
    sensor: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Pixels (k, 2) of the points of the kinematics; NaN for one that was not found."""

    pixels: ArrayLike
    captured_at: float
    covariance: ArrayLike | None = None
    sensor: int = 0


Measurement = Tip | Pose | Points


def raw_values(measurement: Measurement) -> Floats:
    """The values (n,), position (3,) or pixels (k, 2) of a measurement."""
    if isinstance(measurement, Tip):
        return as_floats(measurement.values)
    found = measurement.position if isinstance(measurement, Pose) else measurement.pixels
    return as_floats(found)


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """A measurement and its model.

    Attributes:
        values: (m,).
        covariance: (m, m).
        model: Of values and derivatives.
        predict: The values of the model alone.
        point: How many values are one point.
        name: Of the function that `predict` calls, for messages.
        calls: How often `model` calls it.
        times: How long each call of `model` took [s], if it calls one.
    """

    values: Floats
    covariance: Floats
    model: Model
    predict: Predict
    point: int = 1
    name: str = ""
    calls: int = 0
    times: list[float] = field(default_factory=list)


class Sensors:
    """Turns measurements into readings for a configuration."""

    def __init__(self, config: Config, kinematics: Kinematics | None) -> None:
        self._config, self._kinematics = config, kinematics
        self._count = len(config.dof)
        self._widths = np.array([dof.width_limit for dof in config.dof])

    def reading(self, measurement: Measurement) -> Reading:
        """Reading of a measurement; of a pose the rotation from the measured orientation.

        Raises:
            SignalError: A shape is wrong, a number infinite, all values NaN, the covariance none,
                or the orientation no rotation; the kinematics has no tip, or no points.
        """
        settings, given = self._config.measurement, measurement.covariance
        if isinstance(measurement, Tip):
            values = check_numbers("values", measurement.values, (self._count,))
            identity = np.eye(self._count)
            covariance = _covariance(given, settings.tip_deviation * self._widths)
            return Reading(values, covariance, lambda q: (q, identity), np.copy)
        if isinstance(measurement, Pose):
            kinematics = self._with_tip
            place = check_numbers("position", measurement.position, (3,))
            std = np.full(3, settings.position_deviation)
            if measurement.orientation is None:
                known = _covariance(given, std)
                return self.own(place, known, lambda q: kinematics.tip(q)[0], name="tip(q)")
            turned = check_rotation(measurement.orientation)

            def predict(q: Floats) -> Floats:
                position, rotation = kinematics.tip(q)
                return np.concatenate([position, rotation_vector(turned.T @ rotation)])

            values = np.concatenate([place, np.zeros(3)])
            std = np.concatenate([std, np.full(3, settings.orientation_deviation)])
            return self.own(values, _covariance(given, std), predict, name="tip(q)")
        points: Any = self._with("points", "on_points")
        rows = np.atleast_1d(np.asarray(measurement.pixels, dtype=object))
        shape = min(max(len(rows), 1), MOST_VALUES // 2), 2
        found = check_numbers("pixels", measurement.pixels, shape).ravel()
        covariance = _covariance(given, np.full(found.size, settings.point_deviation))
        name = "points(q)"

        def pixels(q: Floats) -> Floats:
            return check_result(name, points.points(q), shape).ravel()

        return self.own(found, covariance, pixels, point=2, name=name)

    def own(
        self,
        values: Floats,
        covariance: Floats,
        predict: Predict,
        jacobian: Predict | None = None,
        *,
        point: int = 1,
        name: str = "predict(q)",
    ) -> Reading:
        """Reading of values (m,) by a model of the user's, with its Jacobian or by differences."""

        def checked(q: Floats) -> Floats:
            return check_result(name, predict(q), values.shape)

        steps = STEP * self._widths
        derive = jacobian or partial(jacobian_by_differences, checked, steps=steps)
        calls = 1 if jacobian else 1 + 2 * self._count
        times: list[float] = []

        def model(q: Floats) -> tuple[Floats, Floats]:
            begin = perf_counter()
            rows = check_result("jacobian(q)", derive(q), (len(values), len(q)))
            found = checked(q)
            times.append(perf_counter() - begin)
            return found, rows

        return Reading(values, covariance, model, checked, point, name, calls, times)

    @cached_property
    def _with_tip(self) -> Kinematics:
        kinematics = self._with("tip", "on_pose")
        try:
            kinematics.tip(np.array([sum(dof.travel) / 2 for dof in self._config.dof]))
        except SignalError as error:
            allowed = "a class whose tip(q) returns a position (3,) and a rotation matrix (3, 3)"
            kind = self._config.kinematics.kind
            raise ConfigError("kinematics.kind", kind, f"{allowed} ({error})") from None
        return kinematics

    def _with(self, method: str, call: str) -> Kinematics:
        kinematics = self._kinematics
        if kinematics is None or not hasattr(kinematics, method):
            kind = self._config.kinematics.kind
            raise SignalError(call, kind, f"a kinematics.kind with the method {method}(q)")
        return kinematics


def check_rotation(orientation: ArrayLike) -> Floats:
    """Rotation matrix (3, 3) of itself or of a quaternion (4,) x, y, z, w; else a `SignalError`."""
    allowed = "a rotation matrix (3, 3) or a quaternion (4,) x, y, z, w of length 1"
    found = as_numbers("orientation", orientation, allowed)
    if found.shape == (4,) and abs(float(found @ found) - 1) < 2 * _UNIT_LENGTH:
        x, y, z, w = found / np.sqrt(found @ found)
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
    if (
        found.shape == (3, 3)
        and np.allclose(found @ found.T, np.eye(3), atol=_UNIT_LENGTH)
        and np.linalg.det(found) > 0
    ):
        return found
    raise SignalError("orientation", found.tolist(), allowed)


def _covariance(covariance: ArrayLike | None, std: NDArray[np.float64]) -> Floats:
    if covariance is None:
        return np.diag(std**2)
    return check_covariance("covariance", covariance, len(std))
