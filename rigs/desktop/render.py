"""Shaded pictures of solids, without a display: a depth buffer in NumPy."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from build123d import Part
from numpy.typing import NDArray
from PIL import Image

Floats = NDArray[np.float64]
Colour = tuple[int, int, int]

PRINTED: Colour = (235, 145, 55)
MOVED: Colour = (70, 130, 200)
BOUGHT: Colour = (130, 134, 142)
SERVO: Colour = (62, 64, 70)
BRASS: Colour = (200, 170, 80)

_LIGHT = np.array([0.35, -0.45, 0.82])
_FINENESS = 2
"""Samples per pixel in each direction."""


def triangles(part: Part) -> Floats:
    """The surface of a part as triangles (n, 3, 3) [mm]."""
    points, faces = part.tessellate(0.1, 0.25)
    return np.array([(p.X, p.Y, p.Z) for p in points])[np.array(faces)]


def picture(
    parts: list[tuple[Floats, Colour]],
    path: Path,
    *,
    azimuth: float = -55.0,
    elevation: float = 28.0,
    size: tuple[int, int] = (900, 560),
) -> None:
    """Write a parallel projection of coloured triangles that fills a picture.

    Args:
        parts: Triangles of each part, and its colour.
        path: A .png file.
        azimuth: Direction from which it is seen, from the x axis [degrees].
        elevation: Angle above the horizon [degrees].
        size: Width and height [px].
    """
    view = _view(azimuth, elevation)
    width, height = size[0] * _FINENESS, size[1] * _FINENESS
    seen = [triangle @ view.T for triangle, _ in parts]
    every = np.concatenate(seen).reshape(-1, 3)
    low, high = every.min(axis=0), every.max(axis=0)
    scale = 0.94 * min(width / (high[0] - low[0]), height / (high[1] - low[1]))
    centre = (low + high) / 2
    depth = np.full((height, width), -np.inf)
    image = np.full((height, width, 3), 255.0)
    owner = np.full((height, width), -1)
    light = view @ (_LIGHT / np.linalg.norm(_LIGHT))
    for index, (triangle, (_, colour)) in enumerate(zip(seen, parts, strict=True)):
        place = (triangle - centre) * (scale, -scale, scale) + (width / 2, height / 2, 0)
        normal = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
        length = np.linalg.norm(normal, axis=1)
        keep = (length > 0) & (normal[:, 2] > 0)
        shade = 0.42 + 0.58 * np.clip(normal[keep] @ light / length[keep], 0, 1)
        for corners, brightness in zip(place[keep], shade, strict=True):
            _fill(corners, brightness * np.array(colour), index, depth, image, owner)
    _draw_edges(depth, owner, image)
    small = image.reshape(size[1], _FINENESS, size[0], _FINENESS, 3).mean(axis=(1, 3))
    flat = Image.fromarray(small.astype(np.uint8)).quantize(96, dither=Image.Dither.NONE)
    flat.save(path, optimize=True)


def _view(azimuth: float, elevation: float) -> Floats:
    """Rows: right, up and towards the viewer."""
    a, e = math.radians(azimuth), math.radians(elevation)
    towards = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    return np.array([right, np.cross(towards, right), towards])


def _fill(  # noqa: PLR0917
    corners: Floats,
    colour: Floats,
    index: int,
    depth: Floats,
    image: Floats,
    owner: NDArray[np.int_],
) -> None:
    """Draw a triangle where it is nearer than what is there."""
    low = np.maximum(np.floor(corners[:, :2].min(axis=0)).astype(int), 0)
    high = np.ceil(corners[:, :2].max(axis=0)).astype(int) + 1
    rows, columns = slice(low[1], high[1]), slice(low[0], high[0])
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if area == 0:
        return
    shape = depth[rows, columns].shape
    y, x = np.mgrid[low[1] : low[1] + shape[0], low[0] : low[0] + shape[1]] + 0.5
    b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
    c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
    z = az + b * (bz - az) + c * (cz - az)
    drawn = (b >= -1e-9) & (c >= -1e-9) & (b + c <= 1 + 1e-9) & (z > depth[rows, columns])
    depth[rows, columns][drawn] = z[drawn]
    image[rows, columns][drawn] = colour
    owner[rows, columns][drawn] = index


def _draw_edges(depth: Floats, owner: NDArray[np.int_], image: Floats) -> None:
    """Darken where the part changes, or the depth jumps."""
    edge = np.zeros(owner.shape, bool)
    for axis in (0, 1):
        before = [slice(None)] * 2
        after = [slice(None)] * 2
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        first, second = tuple(before), tuple(after)
        with np.errstate(invalid="ignore"):
            jump = np.abs(depth[first] - depth[second]) > 12
        edge[first] |= (owner[first] != owner[second]) | jump
    image[edge] *= 0.35
