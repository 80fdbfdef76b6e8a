"""Background of the simulated images: procedural mucosa, or images of a folder."""

from os import PathLike
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.errors import MissingPathError

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

SUFFIXES = (".jpg", ".jpeg", ".png")

# Blue, green, red.
PALE_TISSUE = (112.0, 130.0, 224.0)
REDNESS = (-5.0, -7.0, 1.0)
VESSEL_ABSORPTION = (0.34, 0.36, 0.16)
ABSORPTION_GAMMA = (1.22, 1.20, 0.92)
REFLECTION = (243.0, 250.0, 255.0)

MAX_DEPTH = 0.26

RAY_GRID = (160, 128)
"""Columns and rows of rays; the wall is smooth, so the image is upsampled from them."""


def load_backgrounds(folder: str | PathLike[str], width: int, height: int) -> list[Image]:
    """Images of a folder, sorted by name, uint8 (height, width, 3) BGR of the camera's size [px].

    Files that are not images are skipped.

    Raises:
        MissingPathError: There is no such folder, or it has no readable image.
    """
    path = Path(folder)
    allowed = "a folder with .jpg or .png images"
    if not path.is_dir():
        raise MissingPathError("twin.background", str(folder), allowed)
    files = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    backgrounds = []
    for file in files:
        if (image := cv2.imread(str(file), cv2.IMREAD_COLOR)) is not None:
            shrinks = image.shape[0] > height or image.shape[1] > width
            method = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
            fitted = cv2.resize(image, (width, height), interpolation=method)
            backgrounds.append(np.ascontiguousarray(fitted, dtype=np.uint8))
    if not backgrounds:
        raise MissingPathError("twin.background", str(folder), allowed)
    return backgrounds


def draw_mucosa(width: int, height: int, seed: int) -> Image:
    """Draw a colon segment: folds around a dark lumen, vessels, specular highlights.

    Rays are cast on a folded tunnel, which is lit from the camera; light falls with a softened
    square of the distance, as under the exposure control of a scope. The same seed gives the same
    bytes: uint8 (height, width, 3), BGR.
    """
    rng = np.random.default_rng(seed)
    depth, facing = _cast_rays(rng)
    distance = _upsample(depth, width, height)
    light = _upsample(facing, width, height) / (1 + (distance / 55e-3) ** 1.7)
    light *= (
        1
        + 0.05 * _fractal_noise(rng, width, height, 5)
        + 0.04 * _fractal_noise(rng, width, height, 60)
    )
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    light *= 1 - 0.30 * np.clip((x * x + y * y) / 2, 0, 1) ** 1.5  # vignetting
    level = np.clip(1.45 * light, 0, 1.2)[..., None]

    redness = _fractal_noise(rng, width, height, 4)[..., None]
    albedo = np.array(PALE_TISSUE) + redness * np.array(REDNESS)
    vessels = _draw_vessels(rng, width, height)[..., None]
    albedo = albedo * (1 - vessels * np.array(VESSEL_ABSORPTION))
    # Light from deep tissue is red: haemoglobin absorbs blue and green.
    colour = albedo * level ** np.array(ABSORPTION_GAMMA)
    reflection = _draw_highlights(rng, _upsample(facing, width, height) * (distance < 60e-3))[
        ..., None
    ]
    colour += reflection * (np.array(REFLECTION) - colour)
    return np.asarray(np.clip(np.rint(colour), 0, 255), dtype=np.uint8)


def _cast_rays(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Depth [m] of the wall along each coarse ray, and the cosine of its incidence angle."""
    columns, rows = RAY_GRID
    x, y = np.meshgrid(np.linspace(-0.85, 0.85, columns), np.linspace(-0.65, 0.65, rows))
    heading = np.array([-0.30, -0.10]) + 0.08 * rng.standard_normal(2)
    turning = np.array([1.2, -1.0]) + 0.8 * rng.standard_normal(2)
    fold_depths = 22e-3 + np.cumsum(rng.uniform(11e-3, 22e-3, 10))
    fold_angles, fold_heights = rng.uniform(0, 2 * np.pi, 10), rng.uniform(0.20, 0.50, 10)
    phase = rng.uniform(0, 2 * np.pi, 3)

    depth = np.full(x.shape, MAX_DEPTH)
    is_hit = np.zeros(x.shape, dtype=bool)
    previous_gap, previous_z = np.full(x.shape, -1.0), 0.0
    for z in np.geomspace(10e-3, MAX_DEPTH, 90):
        across, down = (
            ray * z - slope * z - bow * z * z
            for ray, slope, bow in zip((x, y), heading, turning, strict=True)
        )
        angle = np.arctan2(down, across)
        bulge = 0.07 * np.cos(3 * angle + phase[0]) + 0.06 * np.cos(angle + phase[1])
        radius = 22e-3 * (1 + bulge)
        for fold, turn, high in zip(fold_depths, fold_angles, fold_heights, strict=True):
            if abs(z - fold) > 14e-3:
                continue
            offset = (z - fold - 4e-3 * np.cos(angle - turn + phase[2])) / 3.2e-3
            share = 0.12 + 0.88 * (0.5 + 0.5 * np.cos(angle - turn)) ** 1.6
            radius = radius * (1 - high * share * np.exp(-(offset**2)))
        gap = np.hypot(across, down) - radius
        part = np.clip(previous_gap / np.minimum(previous_gap - gap, -1e-12), 0, 1)
        depth = np.where(~is_hit & (gap >= 0), previous_z + part * (z - previous_z), depth)
        is_hit |= gap >= 0
        previous_gap, previous_z = gap, float(z)

    wall = np.stack([x * depth, y * depth, depth], axis=-1)
    normal = np.cross(_tangent(wall, 1), _tangent(wall, 0))
    cosine = np.abs((normal * wall).sum(-1))
    cosine /= np.linalg.norm(normal, axis=-1) * np.linalg.norm(wall, axis=-1)
    cosine = np.asarray(cv2.GaussianBlur(cosine, (0, 0), 1.5), dtype=np.float64)
    return depth, 0.45 + 0.55 * np.clip(cosine, 0, 1)


def _tangent(wall: Floats, axis: int) -> Floats:
    """Tangent along an axis: difference to the neighbour with the more similar depth."""
    ahead = np.roll(wall, -1, axis) - wall
    behind = np.roll(ahead, 1, axis)
    nearer = np.abs(ahead[..., 2:]) < np.abs(behind[..., 2:])
    return np.where(nearer, ahead, behind)


def _upsample(coarse: Floats, width: int, height: int) -> Floats:
    fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.GaussianBlur(fine, (0, 0), 0.5 * width / RAY_GRID[0]), dtype=np.float64)


def _fractal_noise(rng: np.random.Generator, width: int, height: int, cells: int) -> Floats:
    """Noise of three octaves and unit standard deviation, about ``cells`` coarse features wide."""
    total = np.zeros((height, width), np.float32)
    for octave in range(3):
        n = cells * 2**octave
        coarse = rng.standard_normal((n, n), dtype=np.float32)
        fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
        total += np.asarray(fine, dtype=np.float32) / 2**octave
    return np.asarray(total / max(float(total.std()), 1e-9), dtype=np.float64)


def _draw_vessels(rng: np.random.Generator, width: int, height: int) -> Floats:
    """Opacity of branching vessels per pixel, 0 to 1."""
    canvas = np.zeros((height, width), np.uint8)
    scale = width / 720
    branches = [
        (rng.uniform(0, [width, height]), rng.uniform(0, 2 * np.pi), rng.uniform(1.2, 2.6))
        for _ in range(60)
    ]
    while branches:
        position, heading, diameter = branches.pop()
        path = [position]
        for _ in range(int(rng.integers(9, 20))):
            heading += rng.normal(0, 0.33)
            position = position + 6.5 * scale * np.array([np.cos(heading), np.sin(heading)])
            path.append(position)
        points = np.rint(np.array(path) * 8).astype(np.int32)
        level = int(min(255, 70 + 65 * diameter))
        thick = max(1, round(diameter * scale))
        cv2.polylines(canvas, [points], False, level, thick, cv2.LINE_AA, 3)
        if diameter > 0.75:
            for side in (-1, 1):
                turn = heading + side * rng.uniform(0.3, 0.8)
                branches.append((position, turn, diameter * rng.uniform(0.6, 0.82)))
    soft = cv2.GaussianBlur(canvas.astype(np.float64), (0, 0), 0.9 * scale)
    fade = np.clip(0.55 + 0.4 * _fractal_noise(rng, width, height, 6), 0.1, 1)
    return np.asarray(soft, dtype=np.float64) / 255 * fade


def _draw_highlights(rng: np.random.Generator, facing: Floats) -> Floats:
    """Opacity of specular highlights per pixel, 0 to 1, where the wall faces the light."""
    height, width = facing.shape
    canvas = np.zeros((height, width), np.uint8)
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
            cv2.ellipse(canvas, middle, axes, tilt, 0, 360, 255, -1, cv2.LINE_AA, 3)
    soft = cv2.GaussianBlur(canvas.astype(np.float64), (0, 0), 0.8 * scale)
    glow = cv2.GaussianBlur(canvas.astype(np.float64), (0, 0), 5 * scale)
    return np.asarray(np.clip(soft + 0.22 * glow, 0, 250), dtype=np.float64) / 255
