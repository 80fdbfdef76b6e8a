"""What lies behind the instrument: procedural mucosa, or a folder of images."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.errors import MissingPathError

SUFFIXES = (".jpg", ".jpeg", ".png")

# Blue, green, red.
PALE = (112.0, 130.0, 224.0)
FLUSH = (-5.0, -7.0, 1.0)
VESSEL_ABSORPTION = (0.34, 0.36, 0.16)
DEEPENING = (1.22, 1.20, 0.92)
WET = (243.0, 250.0, 255.0)

DEEPEST = 0.26

COARSE = (160, 128)
"""Columns and rows of rays; the wall is smooth, so the picture is enlarged from them."""


def load_backgrounds(
    folder: str | PathLike[str], width: int, height: int
) -> list[NDArray[np.uint8]]:
    """Read the images of a folder, by name, at the camera's size [px].

    Returns:
        uint8 (height, width, 3) BGR each; files that hold no image are passed over.

    Raises:
        MissingPathError: No such folder, or no image in it that can be read.
    """
    place = Path(folder)
    allowed = "a folder with .jpg or .png images"
    if not place.is_dir():
        raise MissingPathError("twin.background", str(folder), allowed)
    files = sorted(file for file in place.iterdir() if file.suffix.lower() in SUFFIXES)
    backgrounds = [
        _fitted(np.asarray(image, dtype=np.uint8), width, height)
        for file in files
        if (image := cv2.imread(str(file), cv2.IMREAD_COLOR)) is not None
    ]
    if not backgrounds:
        raise MissingPathError("twin.background", str(folder), allowed)
    return backgrounds


def _fitted(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    shrinks = image.shape[0] > height or image.shape[1] > width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    fitted = cv2.resize(image, (width, height), interpolation=method)
    return np.ascontiguousarray(fitted, dtype=np.uint8)


def mucosa(width: int, height: int, seed: int) -> NDArray[np.uint8]:
    """Draw a stretch of colon: folds around a dark lumen, vessels, wet highlights.

    A tunnel whose wall is folded is found along the ray of each pixel, lit from the camera with
    the square of the distance (softened, as the exposure control of a scope does), and painted.

    Args:
        width: [px].
        height: [px].
        seed: Of everything random; the same seed gives the same bytes.

    Returns:
        uint8 (height, width, 3), BGR.
    """
    rng = np.random.default_rng(seed)
    depth, facing = _tunnel(rng)
    distance = _enlarged(depth, width, height)
    light = _enlarged(facing, width, height) / (1 + (distance / 55e-3) ** 1.7)
    light *= 1 + 0.05 * _clouds(rng, width, height, 5) + 0.04 * _clouds(rng, width, height, 60)
    light *= _vignette(width, height)
    level = np.clip(1.45 * light, 0, 1.2)[..., None]

    redness = _clouds(rng, width, height, 4)[..., None]
    albedo = np.array(PALE) + redness * np.array(FLUSH)
    vessels = _vessels(rng, width, height)[..., None]
    albedo = albedo * (1 - vessels * np.array(VESSEL_ABSORPTION))
    # Little light comes back from the deep but red: haemoglobin takes blue and green first.
    colour = albedo * level ** np.array(DEEPENING)
    wet = _highlights(rng, _enlarged(facing, width, height) * (distance < 60e-3))[..., None]
    colour += wet * (np.array(WET) - colour)
    return np.asarray(np.clip(np.rint(colour), 0, 255), dtype=np.uint8)


def _tunnel(rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth [m] and cosine towards the light of the wall each coarse ray meets."""
    columns, rows = COARSE
    x, y = np.meshgrid(np.linspace(-0.85, 0.85, columns), np.linspace(-0.65, 0.65, rows))
    heading = np.array([-0.30, -0.10]) + 0.08 * rng.standard_normal(2)
    turning = np.array([1.2, -1.0]) + 0.8 * rng.standard_normal(2)
    places = 22e-3 + np.cumsum(rng.uniform(11e-3, 22e-3, 10))
    turns, heights = rng.uniform(0, 2 * np.pi, 10), rng.uniform(0.20, 0.50, 10)
    phase = rng.uniform(0, 2 * np.pi, 3)

    depth = np.full(x.shape, DEEPEST)
    met = np.zeros(x.shape, dtype=bool)
    gap_before, z_before = np.full(x.shape, -1.0), 0.0
    for z in np.geomspace(10e-3, DEEPEST, 90):
        across, down = (
            ray * z - slope * z - bow * z * z
            for ray, slope, bow in zip((x, y), heading, turning, strict=True)
        )
        angle = np.arctan2(down, across)
        bulge = 0.07 * np.cos(3 * angle + phase[0]) + 0.06 * np.cos(angle + phase[1])
        radius = 22e-3 * (1 + bulge)
        for place, turn, high in zip(places, turns, heights, strict=True):
            if abs(z - place) > 14e-3:
                continue
            offset = (z - place - 4e-3 * np.cos(angle - turn + phase[2])) / 3.2e-3
            share = 0.12 + 0.88 * (0.5 + 0.5 * np.cos(angle - turn)) ** 1.6
            radius = radius * (1 - high * share * np.exp(-(offset**2)))
        gap = np.hypot(across, down) - radius
        part = np.clip(gap_before / np.minimum(gap_before - gap, -1e-12), 0, 1)
        depth = np.where(~met & (gap >= 0), z_before + part * (z - z_before), depth)
        met |= gap >= 0
        gap_before, z_before = gap, float(z)

    wall = np.stack([x * depth, y * depth, depth], axis=-1)
    normal = np.cross(_slope(wall, 1), _slope(wall, 0))
    cosine = np.abs((normal * wall).sum(-1))
    cosine /= np.linalg.norm(normal, axis=-1) * np.linalg.norm(wall, axis=-1)
    cosine = np.asarray(cv2.GaussianBlur(cosine, (0, 0), 1.5), dtype=np.float64)
    return depth, 0.45 + 0.55 * np.clip(cosine, 0, 1)


def _slope(wall: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Difference to the neighbour on the same fold: the one at the more similar depth."""
    ahead = np.roll(wall, -1, axis) - wall
    behind = np.roll(ahead, 1, axis)
    nearer = np.abs(ahead[..., 2:]) < np.abs(behind[..., 2:])
    return np.where(nearer, ahead, behind)


def _enlarged(coarse: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
    fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.GaussianBlur(fine, (0, 0), 0.5 * width / COARSE[0]), dtype=np.float64)


def _clouds(rng: np.random.Generator, width: int, height: int, cells: int) -> NDArray[np.float64]:
    """Smooth noise of unit deviation, about ``cells`` features across, and finer ones on top."""
    total = np.zeros((height, width), np.float32)
    for octave in range(3):
        n = cells * 2**octave
        coarse = rng.standard_normal((n, n), dtype=np.float32)
        fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
        total += np.asarray(fine, dtype=np.float32) / 2**octave
    return np.asarray(total / max(float(total.std()), 1e-9), dtype=np.float64)


def _vignette(width: int, height: int) -> NDArray[np.float64]:
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    return 1 - 0.30 * np.clip((x * x + y * y) / 2, 0, 1) ** 1.5


def _vessels(rng: np.random.Generator, width: int, height: int) -> NDArray[np.float64]:
    """Share of a vessel in each pixel, 0 to 1: trees that fork and thin out."""
    sheet = np.zeros((height, width), np.uint8)
    scale = width / 720
    walks = [
        (rng.uniform(0, [width, height]), rng.uniform(0, 2 * np.pi), rng.uniform(1.2, 2.6))
        for _ in range(60)
    ]
    while walks:
        place, heading, girth = walks.pop()
        path = [place]
        for _ in range(int(rng.integers(9, 20))):
            heading += rng.normal(0, 0.33)
            place = place + 6.5 * scale * np.array([np.cos(heading), np.sin(heading)])
            path.append(place)
        points = np.rint(np.array(path) * 8).astype(np.int32)
        shade = int(min(255, 70 + 65 * girth))
        thick = max(1, round(girth * scale))
        cv2.polylines(sheet, [points], False, shade, thick, cv2.LINE_AA, 3)
        if girth > 0.75:
            for side in (-1, 1):
                turn = heading + side * rng.uniform(0.3, 0.8)
                walks.append((place, turn, girth * rng.uniform(0.6, 0.82)))
    soft = cv2.GaussianBlur(sheet.astype(np.float64), (0, 0), 0.9 * scale)
    fade = np.clip(0.55 + 0.4 * _clouds(rng, width, height, 6), 0.1, 1)
    return np.asarray(soft, dtype=np.float64) / 255 * fade


def _highlights(rng: np.random.Generator, facing: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the light source's reflection in each pixel, 0 to 1, where the wall faces it."""
    height, width = facing.shape
    sheet = np.zeros((height, width), np.uint8)
    scale = width / 720
    weight = np.where(facing >= np.quantile(facing, 0.80), facing + 1e-9, 0).ravel()
    centres = rng.choice(weight.size, 9, p=weight / weight.sum())
    for centre in centres:
        slant = rng.uniform(0, 180)
        for _ in range(int(rng.integers(2, 11))):
            x, y = np.array([centre % width, centre // width]) + rng.normal(0, 15 * scale, 2)
            size = scale * rng.uniform(0.8, 3.6)
            axes = (round(8 * size * rng.uniform(1, 2.6)), round(8 * size))
            tilt = slant + rng.normal(0, 22)
            middle = (round(8 * x), round(8 * y))
            cv2.ellipse(sheet, middle, axes, tilt, 0, 360, 255, -1, cv2.LINE_AA, 3)
    soft = cv2.GaussianBlur(sheet.astype(np.float64), (0, 0), 0.8 * scale)
    glow = cv2.GaussianBlur(sheet.astype(np.float64), (0, 0), 5 * scale)
    return np.asarray(np.clip(soft + 0.22 * glow, 0, 250), dtype=np.float64) / 255
