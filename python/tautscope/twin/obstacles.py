"""Image disturbances in the scene: stool, specular highlights, debris, smoke.

Images are the light before the sensor: float32 (height, width, 3), BGR, in grey levels of the
undisturbed exposure, not clipped at 255.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.twin.bands import Bands, Floats, Mask
from tautscope.twin.noise import TemporalNoise

LinearImage = NDArray[np.float32]
Disturbed = tuple[LinearImage, Mask | None]
"""The image, and the pixels that now occlude what is behind them."""

REFLECTION = (640.0, 655.0, 660.0)
"""Light of a highlight (B, G, R): saturated for exposure factors from 0.4 on."""

MAX_DEBRIS_SHARE = 0.40
"""Largest share of a band that debris covers."""

_BLOOD, _CLOT, _MUCUS, _MUD = (22, 18, 128), (20, 18, 62), (88, 128, 168), (34, 66, 104)
_DEBRIS = np.array([_BLOOD, _BLOOD, _CLOT, _MUCUS, _MUD], dtype=np.float32)
_BROWN, _YELLOW, _GREEN = (30, 74, 112), (52, 150, 176), (44, 128, 118)
_STOOL = np.array([_BROWN, _YELLOW, _GREEN], dtype=np.float32)

SMOKE = np.array((206.0, 208.0, 212.0), dtype=np.float32)
MAX_SMOKE_OPACITY = 0.65


def stool(light: LinearImage, _: Bands, noise: TemporalNoise) -> Disturbed:
    """Brown, yellow and green patches on the tissue that move slowly."""
    height, width = light.shape[:2]
    size = max(1, width // 3), max(1, height // 3)
    where = noise.field("where", *size, 4, 0.004)
    # Never none; at most about a quarter of the image.
    threshold = 0.95 - 0.30 * noise.scalar("amount", 80)
    kind = 1 + 0.9 * noise.field("kind", *size, 3, 0.0)
    grain = noise.field("grain", *size, 40, 0.0)
    opacity = np.clip((where - threshold) / 0.30, 0, 1) * (0.84 + 0.08 * np.clip(grain, -1, 1))
    parts = np.stack([np.clip(1 - np.abs(kind - k), 0, 1) for k in range(3)], axis=-1)
    colour = parts @ _STOOL / np.maximum(parts.sum(axis=-1, keepdims=True), 1e-3)
    colour *= (1 + 0.07 * grain)[..., None] / 130
    opacity = _upsample(opacity, light)[..., None]
    lit = np.clip(light @ np.full((3, 1), 1 / 3, dtype=np.float32), 16, 175)
    return light + opacity * (_upsample(colour, light) * lit - light), None


def highlights(light: LinearImage, bands: Bands, noise: TemporalNoise) -> Disturbed:
    """Specular reflections of the lamp on each band: streaks along and across it, and spots."""
    hidden = np.zeros(light.shape[:2], dtype=bool)
    along = bands.axis()
    across = np.array([-along[1], along[0]])
    for k in bands.visible_bands():
        length, thickness = max(bands.extent(k, along), 4.0), max(bands.extent(k, across), 4.0)
        for kind in ("along", "across", "spot"):
            number, level = noise.episode(f"{kind}{k}", 36)
            rng = noise.generator(kind, k, number)
            if rng.uniform() < 0.25:
                continue
            shift = noise.scalar(f"shift {kind}{k}", 30)
            if kind == "along":
                offset = 0.1 * shift * length * along + rng.uniform(-0.3, 0.3) * thickness * across
                semi_axes = rng.uniform([0.35, 0.03], [0.65, 0.09])
            elif kind == "across":
                offset = 0.28 * shift * length * along
                semi_axes = rng.uniform([0.03, 0.30], [0.10, 0.44])
            else:
                offset = 0.30 * (shift * length * along + rng.uniform(-1, 1) * thickness * across)
                semi_axes = rng.uniform([0.06, 0.05], [0.16, 0.14])
            semi_axes = np.maximum(semi_axes * [length, thickness], 0.8)
            tilt = float(np.arctan2(along[1], along[0]) + rng.normal(0, 0.1))
            centre = bands.centre(k) + offset
            _blend_streak(light, hidden, centre, semi_axes, tilt=tilt, level=level)
    return light, hidden


def _blend_streak(
    light: LinearImage,
    hidden: Mask,
    centre: Floats,
    semi_axes: Floats,
    *,
    tilt: float,
    level: float,
) -> None:
    """Blend in an elliptic reflection with a soft, uneven edge and a faint halo, all [px, rad].

    Image and mask of the hidden pixels are changed in place; `level` is the opacity.
    """
    box = _crop(light, centre, float(semi_axes.max()) + 10)
    if box is None or level < 0.02:
        return
    x, y = _offsets(box, centre)
    u, v = x * np.cos(tilt) + y * np.sin(tilt), y * np.cos(tilt) - x * np.sin(tilt)
    a, b = semi_axes
    ripple = 1 + 0.22 * np.sin(0.35 * u + a) + 0.12 * np.sin(0.83 * u + b)
    b = b * ripple
    # Signed distance to the ellipse [px], to first order.
    level_set = np.hypot(u / a, v / b)
    distance = (1 - level_set) * level_set / np.maximum(np.hypot(u / a**2, v / b**2), 1e-6)
    sharp = (1 / (1 + np.exp(-3.3 * np.clip(distance, -8, 8)))).astype(np.float32)
    glow = 0.12 * np.asarray(cv2.GaussianBlur(sharp, (0, 0), 2.5))
    opacity = (np.float32(level) * np.maximum(sharp, glow))[..., None]
    part = light[box]
    part += opacity * (np.array(REFLECTION, dtype=np.float32) - part)
    hidden[box] |= opacity[..., 0] > 0.4


def debris(light: LinearImage, bands: Bands, noise: TemporalNoise) -> Disturbed:
    """A lump of blood, clot or mucus that moves over one band and covers up to 40 % of it."""
    visible = bands.visible_bands()
    number, level = noise.episode("lump", 60)
    if not visible or level < 0.02:
        return light, None
    rng = noise.generator("lump", number)
    target = visible[int(rng.integers(len(visible)))]
    max_share = MAX_DEBRIS_SHARE * level * rng.uniform(0.5, 1.0)
    # The lump comes from the side, so that it meets the other band only if that is right behind.
    along = bands.axis()
    angle = float(np.arctan2(along[1], along[0])) + rng.choice([-1, 1]) * np.pi / 2
    angle += rng.uniform(-0.4, 0.4) + 0.4 * noise.scalar("angle", 60)
    direction = np.array([np.cos(angle), np.sin(angle)])
    size = float(np.sqrt(bands.area[bands.band == target].sum())) * rng.uniform(0.5, 0.85)
    orders = np.arange(1, 9)
    wobble = 0.15 * rng.standard_normal((2, len(orders))) / orders**1.1
    tilt, stretch = rng.uniform(0, np.pi), rng.uniform(1.0, 1.45)

    def depth(x: Floats, y: Floats) -> Floats:
        """Depth inside the lump [px] of a point relative to the lump's centre."""
        x, y = x * np.cos(tilt) + y * np.sin(tilt), y * np.cos(tilt) - x * np.sin(tilt)
        x, y = x / stretch, y * stretch
        turn = orders * np.arctan2(y, x)[..., None]
        radius = 1 + np.cos(turn) @ wobble[0] + np.sin(turn) @ wobble[1]
        return np.asarray(size * np.maximum(radius, 0.3) - np.hypot(x, y))

    patches, band_centre = bands.subsample(500), bands.centre(target)

    def covered(offset: float) -> float:
        x, y = (patches.pixels - band_centre - offset * direction).T
        inside = depth(x, y) > 0
        return max(patches.area_share(k, inside) for k in (0, 1))

    far, near = 2.5 * size + bands.extent(target, direction), 0.0
    for _ in range(12):
        middle = 0.5 * (far + near)
        far, near = (far, middle) if covered(middle) > max_share else (middle, near)
    centre = band_centre + far * direction
    box = _crop(light, centre, 2.2 * size)
    if box is None:
        return light, None
    x, y = _offsets(box, centre)
    inside = depth(x, y)
    part = light[box]
    wet = 1 + 0.16 * np.sin(x * 0.21 + 9 * wobble[1, 0]) * np.sin(y * 0.26 + 9 * wobble[1, 1])
    round_off = 0.62 + 0.38 * np.clip(inside / (0.45 * size), 0, 1)
    colour = _DEBRIS[int(rng.integers(len(_DEBRIS)))] * (wet * round_off)[..., None]
    glint = np.exp(-((x / size + 0.25) ** 2 / 0.010 + (y / size + 0.30) ** 2 / 0.004))
    colour = colour + (150 * glint)[..., None]
    # At the ends of an episode the lump fades in and out beside the band.
    opacity = min(1.0, level / 0.15)
    opaque = (opacity * np.clip(0.5 + inside / 1.6, 0, 1))[..., None].astype(np.float32)
    part += opaque * (colour.astype(np.float32) - part)
    hidden = np.zeros(light.shape[:2], dtype=bool)
    hidden[box] = (inside > 0) & (opacity > 0.5)
    return light, hidden


def smoke(light: LinearImage, _: Bands, noise: TemporalNoise) -> Disturbed:
    """Drifting smoke: (1 - t) light + t smoke, with opacity t up to 0.65, uneven in the image."""
    height, width = light.shape[:2]
    amount = 0.5 + 0.5 * noise.scalar("amount", 60)
    size = max(1, width // 6), max(1, height // 6)
    swirl = noise.field("swirl", *size, 3, 0.05)
    density = np.clip(MAX_SMOKE_OPACITY * amount * (0.78 + 0.22 * swirl), 0, MAX_SMOKE_OPACITY)
    opacity = _upsample(density, light)
    # Per channel: NumPy's broadcast over three channels took as long as rendering the scene.
    added = cv2.merge([opacity * channel for channel in SMOKE])
    return np.asarray(cv2.multiply(light, cv2.merge([1 - opacity] * 3)) + added, np.float32), None


def _upsample(coarse: LinearImage, light: LinearImage) -> LinearImage:
    height, width = light.shape[:2]
    fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(fine, dtype=np.float32)


def _crop(light: LinearImage, centre: Floats, reach: float) -> tuple[slice, slice] | None:
    """Rows and columns within ``reach`` [px] of a point; None outside the image."""
    height, width = light.shape[:2]
    left, top = (max(0, int(c - reach)) for c in centre)
    right, bottom = (
        min(size, int(c + reach) + 2) for size, c in zip((width, height), centre, strict=True)
    )
    return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None


def _offsets(box: tuple[slice, slice], centre: Floats) -> tuple[Floats, Floats]:
    rows, columns = box
    x, y = np.meshgrid(
        np.arange(columns.start, columns.stop) - centre[0],
        np.arange(rows.start, rows.stop) - centre[1],
    )
    return x, y
