"""Poses to an axis: the turn of a quaternion, and the travel of a point, as one number."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_ROUNDING = 0.01
"""How far the length of a quaternion may be from 1."""


def find_axes(titles: Sequence[str]) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Prefix and columns of each quaternion (x, y, z, w) and point (x, y, z) among titles.

    Four or three titles belong together if they differ in their last letter alone.
    """
    places = {title: index for index, title in enumerate(titles)}
    for title in titles:
        prefix, last = title[:-1], title[-1:]
        if last not in ("x", "X"):
            continue
        letters = "xyzw" if last == "x" else "XYZW"
        found = [places.get(prefix + letter) for letter in letters]
        known = tuple(each for each in found if each is not None)
        if found[:3] == list(known[:3]) and len(known) >= 3:
            yield prefix, known


def title_of(prefix: str, name: str) -> str:
    """``tip_`` and ``turn`` as ``tip_turn``, ``q`` and ``turn`` as ``q_turn``."""
    return f"{prefix}{'_' if prefix[-1:].isalnum() else ''}{name}"


def turn(quaternions: Floats) -> Floats | None:
    """Angle (n,) [rad] of quaternions (n, 4) about the axis of their largest turns.

    Of each rotation since the first one, (v, w), the part about the axis a is
    2 atan2(v . a, w), without jumps; a is the main direction of all v.

    Returns:
        None if they are no quaternions of length 1. NaN where one is missing or 0.
    """
    angle = np.full(len(quaternions), np.nan)
    lengths = np.linalg.norm(quaternions, axis=1)
    known = np.flatnonzero(np.isfinite(lengths) & (lengths > 0))
    if not len(known) or np.any(np.abs(lengths[known] - 1) > _ROUNDING):
        return None
    given = quaternions[known] / lengths[known, None]
    v, w = given[:, :3], given[:, 3:]
    v0, w0 = v[0], w[0]
    relative = np.hstack([w0 * v - w * v0 - np.cross(v0, v), w * w0 + v @ v0[:, None]])
    signs = np.sign(np.sum(relative[1:] * relative[:-1], axis=1))
    relative[1:] *= np.cumprod(np.where(signs == 0, 1, signs))[:, None]
    along = relative[:, :3] @ _main_direction(relative[:, :3])
    angle[known] = 2 * np.unwrap(np.arctan2(along, relative[:, 3]))
    return angle


def travel(points: Floats) -> Floats:
    """Distance (n,) of points (n, 3) from the first one along the line of their largest motion."""
    known = np.isfinite(points).all(axis=1)
    if not known.any():
        return np.full(len(points), np.nan)
    first = points[known][0]
    centred = points[known] - points[known].mean(axis=0)
    return np.where(known, (points - first) @ _main_direction(centred), np.nan)


def _main_direction(vectors: Floats) -> Floats:
    """Unit vector (3,); its largest component is positive."""
    direction = np.linalg.eigh(vectors.T @ vectors)[1][:, -1]
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))
