"""Measurements of a log: conversion of a `Tip`, `Pose` or `Points` to messages, and back."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from tautscope.errors import RecordError
from tautscope.log import topics
from tautscope.log.cdr import Message
from tautscope.log.fields import multi_array
from tautscope.loop.kinematics import Floats
from tautscope.loop.measurement import Measurement, Points, Pose, Tip, check_rotation, raw_values

_TIMES = ("captured_at", "sensor")
_QUATERNION = ("q_x", "q_y", "q_z", "q_w")
_MATRIX = tuple(f"r_{row}{column}" for row in "xyz" for column in "xyz")


def measurement_messages(
    header: Message, measurement: Measurement, dofs: Sequence[str]
) -> dict[str, Message]:
    """The messages of a measurement; numbers are those of the sensor, to the last bit.

    The labels of the array are kind and names: ``pose`` and ``captured_at,sensor,x,y,z``, with
    q_x to q_w of a quaternion or r_xx to r_zz, row by row, of a rotation matrix; ``tip`` and the
    names of the degrees of freedom; ``points`` and u_0, v_0, u_1, ... of the points [px].
    """
    messages: dict[str, Message] = {}
    # First, so that a truncated log never has a measurement without its covariance.
    if measurement.covariance is not None:
        covariance = np.asarray(measurement.covariance, dtype=np.float64)
        sides = dict(zip(("row", "column"), covariance.shape, strict=True))
        messages[topics.COVARIANCE] = multi_array(sides, covariance.ravel())
    if isinstance(measurement, Pose):
        messages[topics.POSE] = {"header": header, "pose": _pose(measurement)}
    kind, names = type(measurement).__name__.lower(), (*_TIMES, *_names(measurement, dofs))
    numbers = [measurement.captured_at, measurement.sensor, *raw_values(measurement).ravel()]
    if isinstance(measurement, Pose) and measurement.orientation is not None:
        numbers.extend(np.ravel(np.asarray(measurement.orientation, dtype=np.float64)))
    messages[topics.MEASUREMENT] = multi_array({kind: 1, ",".join(names): len(names)}, numbers)
    return messages


def read_measurement(messages: Mapping[str, bytes], dofs: Sequence[str]) -> Measurement:
    """Read the measurement of `measurement_messages`.

    Raises:
        RecordError: Kind or names are none of those; the error names the topic.
    """
    found = topics.decode(topics.MEASUREMENT, messages[topics.MEASUREMENT])
    covariance = None
    if topics.COVARIANCE in messages:
        matrix = topics.decode(topics.COVARIANCE, messages[topics.COVARIANCE])
        sides = [side.size for side in matrix.layout.dim]
        covariance = np.array(matrix.data).reshape(sides)
    labels = [side.label for side in found.layout.dim]
    with suppress(ValueError):
        kind, names = labels
        captured_at, sensor, *numbers = found.data.tolist()
        made = _made(kind, np.array(numbers), captured_at, covariance, int(sensor))
        if names == ",".join((*_TIMES, *_names(made, dofs))):
            return made
    allowed = f"tip with {', '.join(dofs)}; pose or points, with their names"
    raise RecordError(topics.MEASUREMENT, " ".join(labels), allowed)


def value_names(measurement: Measurement, dofs: Sequence[str]) -> list[str]:
    """Names of the values that the loop compares: of an orientation the rotation from it."""
    names = _names(measurement, dofs)
    if isinstance(measurement, Pose) and measurement.orientation is not None:
        return [*names[:3], "rotation_x", "rotation_y", "rotation_z"]
    return list(names)


def _made(
    kind: str, values: Floats, captured_at: float, covariance: Floats | None, sensor: int
) -> Measurement:
    if kind == "tip":
        return Tip(values, captured_at, covariance, sensor)
    if kind == "points":
        return Points(values.reshape(-1, 2), captured_at, covariance, sensor)
    if kind != "pose":
        raise ValueError(kind)
    position, turned = values[:3], values[3:]
    orientation = turned.reshape(3, 3) if turned.size == len(_MATRIX) else turned
    return Pose(position, captured_at, orientation if turned.size else None, covariance, sensor)


def _names(measurement: Measurement, dofs: Sequence[str]) -> tuple[str, ...]:
    if isinstance(measurement, Tip):
        return tuple(dofs)
    if isinstance(measurement, Points):
        count = len(np.asarray(measurement.pixels))
        return tuple(f"{axis}_{point}" for point in range(count) for axis in "uv")
    if measurement.orientation is None:
        return ("x", "y", "z")
    is_matrix = np.ndim(measurement.orientation) == 2
    return ("x", "y", "z", *(_MATRIX if is_matrix else _QUATERNION))


def _pose(measurement: Pose) -> dict[str, Any]:
    """geometry_msgs/msg/Pose, for viewers; without an orientation that of the frame."""
    x, y, z = (float(value) for value in np.asarray(measurement.position))
    quaternion: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    if measurement.orientation is not None:
        quaternion = _quaternion(check_rotation(measurement.orientation))
    turned = dict(zip("xyzw", quaternion, strict=True))
    return {"position": {"x": x, "y": y, "z": z}, "orientation": turned}


def _quaternion(rotation: Floats) -> tuple[float, ...]:
    """Quaternion x, y, z, w, w >= 0, of a rotation matrix (3, 3).

    Every row of 4 q q^T is a multiple of q; the one with the largest diagonal is the most exact.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    products = np.array(
        [
            [1 + xx - yy - zz, xy + yx, xz + zx, zy - yz],
            [xy + yx, 1 - xx + yy - zz, yz + zy, xz - zx],
            [xz + zx, yz + zy, 1 - xx - yy + zz, yx - xy],
            [zy - yz, xz - zx, yx - xy, 1 + xx + yy + zz],
        ]
    )
    row = products[np.argmax(np.diag(products))]
    unit = row / np.sqrt(row @ row)
    return tuple(float(value) for value in (unit if unit[3] >= 0 else -unit))
