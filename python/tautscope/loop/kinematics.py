"""Where the tip is in a state of the degrees of freedom."""

import math
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config, KinematicsConfig
from tautscope.errors import ConfigError, SignalError
from tautscope.loop.named_class import instance, named_class
from tautscope.loop.signal_checks import check_result

Floats = NDArray[np.float64]
Predict = Callable[[Floats], Floats]

STEP = 1e-5
"""Step of a difference, over the width limit of the degree of freedom."""
_SMALL = 1e-4
"""Angle below which the series of a sine is as exact [rad]."""


@runtime_checkable
class Kinematics(Protocol):
    """Position and orientation of the tip in a state.

    A class may also have ``points(q)``: (k, 2) pixels of named points, for `on_points`.
    """

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        """Position (3,) [m] and rotation matrix (3, 3) of the tip in a state q (n,)."""


class TwoPlanes:
    """A section of constant curvature that bends in two planes.

    With the skew k of the planes, the bending vector b = (bend_x - bend_y sin k, bend_y cos k),
    theta = |b|, insertion s along z, rotation r about z, length l of the section and t of the rigid
    tip:

        p = Rz(r) ((0, 0, s) + l (b_x, b_y) (1 - cos theta) / theta^2, l sin(theta) / theta in z
            + R(b) (0, 0, t)),      orientation Rz(r) R(b)

    where R(b) turns by theta about (-b_y, b_x, 0) / theta. Smooth in every state, also where the
    section is straight. Webster and Jones, Int. J. Robotics Research 29, 2010.

    Wrong for a section that does not bend evenly.

    Raises:
        ConfigError: bend_x or bend_y is missing, or there is another degree of freedom.
    """

    NAMES = ("bend_x", "bend_y", "insertion", "rotation")

    def __init__(self, config: Config) -> None:
        places = _moving(config)
        for name in places:
            if name not in self.NAMES:
                allowed = f"one of {', '.join(self.NAMES)}, or named in kinematics.without"
                raise ConfigError("dof.name", name, allowed)
        for name in self.NAMES[:2]:
            if name not in places:
                raise ConfigError("dof", list(places), f'a degree of freedom "{name}"')
        self._place = [places.get(name) for name in self.NAMES]
        self._length, self._tip = config.kinematics.length, config.kinematics.tip_length
        skew = config.kinematics.skew
        self._aside, self._along = math.sin(skew), math.cos(skew)

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        """Position (3,) [m] and rotation matrix (3, 3) of the tip in a state q (n,)."""
        values = (0.0 if place is None else float(q[place]) for place in self._place)
        bend_x, bend_y, insertion, rotation = values
        bend_x, bend_y = bend_x - bend_y * self._aside, bend_y * self._along
        arc, turned = _arc(bend_x, bend_y, self._length)
        position = arc + turned[:, 2] * self._tip
        position[2] += insertion
        if self._place[3] is None:
            return position, turned
        about = rotation_matrix(np.array([0.0, 0.0, rotation]))
        return about @ position, about @ turned


class Own:
    """A class of the user's, whose tip is checked and copied."""

    def __init__(self, kinematics: Kinematics) -> None:
        self.own = kinematics

    def __getattr__(self, name: str) -> Any:
        if name == "own" or name.startswith("_"):  # copies and pickles ask before there is one
            raise AttributeError(name)
        return getattr(self.own, name)

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        """Position (3,) [m] and rotation matrix (3, 3) of the tip in a state q (n,).

        Raises:
            SignalError: The class returned something else.
        """
        found: object = self.own.tip(q)
        if not isinstance(found, tuple | list) or len(found) != 2:
            allowed = "a position (3,) and a rotation matrix (3, 3)"
            raise SignalError("tip(q)", type(found).__name__, allowed)
        position, rotation = found
        return check_result("tip(q)", position, (3,)), check_result("tip(q)", rotation, (3, 3))


class Placed(Own):
    """A kinematics in the frame of a sensor.

    With the base's position b and rotation B, and the rotation S of the sensor at the tip,

        p' = b + B p,      R' = B R S.
    """

    def __init__(self, kinematics: Kinematics, config: KinematicsConfig) -> None:
        super().__init__(kinematics)
        self._position = np.array(config.base_position)
        self._base = rotation_matrix(np.array(config.base_rotation))
        self._sensor = rotation_matrix(np.array(config.sensor_rotation))

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        """Position (3,) [m] and rotation matrix (3, 3) that the sensor measures in a state."""
        position, rotation = self.own.tip(q)
        return self._position + self._base @ position, self._base @ rotation @ self._sensor


class Segments:
    """Sections of constant curvature in a row, of one length, each bending in two planes.

    The degrees of freedom are bend_x and bend_y of each section in turn, from the base on, as those
    of `TwoPlanes`; with p_k and R_k of a section by itself and t of the rigid tip:

        p = p_1 + R_1 (p_2 + R_2 (... + R_n (0, 0, t))),      orientation R_1 R_2 ... R_n

    Wrong for sections of different lengths, and for one that does not bend evenly.

    Raises:
        ConfigError: The number of degrees of freedom is odd.
    """

    def __init__(self, config: Config) -> None:
        self._places = list(_moving(config).values())
        if len(self._places) % 2:
            raise ConfigError("dof", len(self._places), "two degrees of freedom per segment")
        self._length, self._tip = config.kinematics.length, config.kinematics.tip_length

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        """Position (3,) [m] and rotation matrix (3, 3) of the tip in a state q (n,)."""
        position, turned = np.zeros(3), np.eye(3)
        for bend_x, bend_y in np.reshape(q[self._places], (-1, 2)).tolist():
            arc, about = _arc(bend_x, bend_y, self._length)
            position = position + turned @ arc
            turned = turned @ about
        return position + turned[:, 2] * self._tip, turned


def _moving(config: Config) -> dict[str, int]:
    """Name and place of each degree of freedom that moves the tip."""
    without = config.kinematics.without
    return {dof.label: k for k, dof in enumerate(config.dofs) if dof.label not in without}


def _arc(bend_x: float, bend_y: float, length: float) -> tuple[Floats, Floats]:
    """End (3,) and rotation matrix (3, 3) of an arc that begins at 0 along z."""
    angle = math.hypot(bend_x, bend_y)
    if angle < _SMALL:
        along, aside = 1.0 - angle**2 / 6, 0.5
    else:
        along, aside = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    turned = rotation_matrix(np.array([-bend_y, bend_x, 0.0]))
    return length * np.array([bend_x * aside, bend_y * aside, along]), turned


def build_kinematics(config: Config) -> Kinematics | None:
    """As `own_kinematics`, in the frame of the sensor that measures poses."""
    kinematics, own = own_kinematics(config), config.kinematics
    is_placed = any((*own.base_position, *own.base_rotation, *own.sensor_rotation))
    return Placed(kinematics, own) if is_placed and kinematics is not None else kinematics


def own_kinematics(config: Config) -> Kinematics | None:
    """The kinematics in its own frame; None where the tip is measured degree by degree.

    A class of yours is called without arguments.

    Raises:
        ConfigError: There is no such module or class, it needs arguments, or has no method ``tip``.
    """
    kind = config.kinematics.kind
    if kind == "joints":
        return None
    if kind == "two_planes":
        return TwoPlanes(config)
    if kind == "segments":
        return Segments(config)
    field, allowed = "kinematics.kind", '"joints", "two_planes", "segments" or "module:Class"'
    kinematics = instance(field, kind, named_class(field, kind, allowed))
    if not isinstance(kinematics, Kinematics):
        raise ConfigError(field, kind, "a class with the method tip(q)")
    return Own(kinematics)


def jacobian_by_differences(predict: Predict, q: Floats, steps: Floats) -> Floats:
    """dz/dq (m, n) by central differences with steps (n,)."""
    columns = []
    for index, step in enumerate(steps):
        ahead, behind = q.copy(), q.copy()
        ahead[index] += step
        behind[index] -= step
        columns.append((predict(ahead) - predict(behind)) / (2 * step))
    return np.stack(columns, axis=1)


def rotation_matrix(vector: Floats) -> Floats:
    """Rotation matrix (3, 3) of a rotation vector (3,) [rad], by Rodrigues' formula."""
    # In single numbers: a pose is predicted some tens of times per measurement.
    x, y, z = np.asarray(vector, dtype=np.float64).tolist()
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < _SMALL:
        first, second = 1.0 - square / 6, 0.5 - square / 24
    else:
        first, second = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
    cosine = 1.0 - second * square
    return np.array(
        [
            [cosine + second * x * x, second * x * y - first * z, second * x * z + first * y],
            [second * x * y + first * z, cosine + second * y * y, second * y * z - first * x],
            [second * x * z - first * y, second * y * z + first * x, cosine + second * z * z],
        ]
    )


def rotation_vector(matrix: Floats) -> Floats:
    """Rotation vector (3,) [rad] of a rotation matrix (3, 3)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix.tolist()
    skew = (zy - yz, xz - zx, yx - xy)
    sine, cosine = math.hypot(*skew) / 2, (xx + yy + zz - 1) / 2
    angle = math.atan2(sine, cosine)
    if sine < _SMALL and cosine < 0.0:
        # Near half a turn the skew part vanishes; the rest is (1 - cos) n n' of the axis n.
        outer = (matrix + matrix.T) / 2 - cosine * np.eye(3)
        axis: Floats = outer[:, np.argmax(np.diagonal(outer))]
        return axis * math.copysign(angle / math.hypot(*axis), np.dot(axis, skew))
    scale = (1.0 + angle**2 / 6 if sine < _SMALL else angle / sine) / 2
    return np.array([scale * each for each in skew])
