"""What lies between camera and instrument, or on the tissue: stool, highlights, debris, smoke.

Pictures here are light: float32 (height, width, 3), blue, green, red, in grey levels of the
undisturbed exposure, and not limited at 255: a reflection of the lamp is far above it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tautscope.twin.drift import Bands, Drift, Floats, Light, Mask

REFLECTION = (640.0, 655.0, 660.0)
"""Light of a highlight: saturated up to an exposure of 0.4, still bright below."""

DEBRIS_SHARE = 0.40
"""Largest share of a band that debris covers."""

_BLOOD, _CLOT, _MUCUS, _MUD = (22, 18, 128), (20, 18, 62), (88, 128, 168), (34, 66, 104)
_DEBRIS = np.array([_BLOOD, _BLOOD, _CLOT, _MUCUS, _MUD], dtype=np.float32)
_BROWN, _YELLOW, _GREEN = (30, 74, 112), (52, 150, 176), (44, 128, 118)
_STOOL = np.array([_BROWN, _YELLOW, _GREEN], dtype=np.float32)

VEIL = np.array((206.0, 208.0, 212.0), dtype=np.float32)
DENSEST = 0.65
"""Largest share of light that comes from the smoke and not from what is behind it."""


def stool(light: Light, _: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """Brown, yellow and green patches that stick to the tissue and slide slowly over it."""
    height, width = light.shape[:2]
    size = max(1, width // 3), max(1, height // 3)
    where = drift.clouds("where", *size, 4, 0.004)
    # Always some, at times a quarter of the picture.
    edge = 0.95 - 0.30 * drift.wander("amount", 80)
    kind = 1 + 0.9 * drift.clouds("kind", *size, 3, 0.0)
    grain = drift.clouds("grain", *size, 40, 0.0)
    thick = np.clip((where - edge) / 0.30, 0, 1) * (0.84 + 0.08 * np.clip(grain, -1, 1))
    parts = np.stack([np.clip(1 - np.abs(kind - k), 0, 1) for k in range(3)], axis=-1)
    colour = parts @ _STOOL / np.maximum(parts.sum(axis=-1, keepdims=True), 1e-3)
    colour *= (1 + 0.07 * grain)[..., None] / 130
    thick = _enlarged(thick, light)[..., None]
    lit = np.clip(light @ np.full((3, 1), 1 / 3, dtype=np.float32), 16, 175)
    return light + thick * (_enlarged(colour, light) * lit - light), None


def highlights(light: Light, bands: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """Streaks of reflected lamp light on each band: along it, across it, and in spots."""
    hidden = np.zeros(light.shape[:2], dtype=bool)
    along = bands.axis()
    across = np.array([-along[1], along[0]])
    for k in bands.drawn():
        length, girth = max(bands.extent(k, along), 4.0), max(bands.extent(k, across), 4.0)
        for kind in ("along", "across", "spot"):
            number, level = drift.episode(f"{kind}{k}", 36)
            chance = drift.generator(kind, k, number)
            if chance.uniform() < 0.25:
                continue
            shift = drift.wander(f"shift {kind}{k}", 30)
            if kind == "along":
                place = 0.1 * shift * length * along + chance.uniform(-0.3, 0.3) * girth * across
                half = chance.uniform([0.35, 0.03], [0.65, 0.09])
            elif kind == "across":
                place = 0.28 * shift * length * along
                half = chance.uniform([0.03, 0.30], [0.10, 0.44])
            else:
                place = 0.30 * (shift * length * along + chance.uniform(-1, 1) * girth * across)
                half = chance.uniform([0.06, 0.05], [0.16, 0.14])
            half = np.maximum(half * [length, girth], 0.8)
            tilt = float(np.arctan2(along[1], along[0]) + chance.normal(0, 0.1))
            _Streak(bands.centre(k) + place, half, tilt, level).shine(light, hidden)
    return light, hidden


@dataclass(frozen=True, slots=True)
class _Streak:
    """An ellipse of reflected light with a soft, uneven edge and a faint glow around it.

    Attributes:
        centre: [px].
        half: Its two half axes [px].
        tilt: Of the first axis, from u to v [rad].
        level: 0 to 1.
    """

    centre: Floats
    half: Floats
    tilt: float
    level: float

    def shine(self, light: Light, hidden: Mask) -> None:
        """Add it to the light, in place."""
        box = _box(light, self.centre, float(self.half.max()) + 10)
        if box is None or self.level < 0.02:
            return
        x, y = _grid(box, self.centre)
        cos, sin = np.cos(self.tilt), np.sin(self.tilt)
        u, v = x * cos + y * sin, y * cos - x * sin
        a, b = self.half
        ripple = 1 + 0.22 * np.sin(0.35 * u + a) + 0.12 * np.sin(0.83 * u + b)
        b = b * ripple
        # Distance inside the ellipse, to first order.
        level_set = np.hypot(u / a, v / b)
        edge = (1 - level_set) * level_set / np.maximum(np.hypot(u / a**2, v / b**2), 1e-6)
        sharp = (1 / (1 + np.exp(-3.3 * np.clip(edge, -8, 8)))).astype(np.float32)
        glow = 0.12 * np.asarray(cv2.GaussianBlur(sharp, (0, 0), 2.5))
        share = (np.float32(self.level) * np.maximum(sharp, glow))[..., None]
        part = light[box]
        part += share * (np.array(REFLECTION, dtype=np.float32) - part)
        hidden[box] |= share[..., 0] > 0.4


def debris(light: Light, bands: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """A lump of blood, clot or mucus that slides over one band, up to 40 % of it."""
    drawn = bands.drawn()
    number, level = drift.episode("lump", 60)
    if not drawn or level < 0.02:
        return light, None
    chance = drift.generator("lump", number)
    target = drawn[int(chance.integers(len(drawn)))]
    share = DEBRIS_SHARE * level * chance.uniform(0.5, 1.0)
    # From the side, so that it meets the other band only where that lies right behind.
    along = bands.axis()
    angle = float(np.arctan2(along[1], along[0])) + chance.choice([-1, 1]) * np.pi / 2
    angle += chance.uniform(-0.4, 0.4) + 0.4 * drift.wander("angle", 60)
    way = np.array([np.cos(angle), np.sin(angle)])
    size = float(np.sqrt(bands.area[bands.band == target].sum())) * chance.uniform(0.5, 0.85)
    orders = np.arange(1, 9)
    wobble = 0.15 * chance.standard_normal((2, len(orders))) / orders**1.1
    tilt, stretch = chance.uniform(0, np.pi), chance.uniform(1.0, 1.45)

    def depth(x: Floats, y: Floats) -> Floats:
        """How far inside the lump a place relative to its middle is [px]."""
        x, y = x * np.cos(tilt) + y * np.sin(tilt), y * np.cos(tilt) - x * np.sin(tilt)
        x, y = x / stretch, y * stretch
        turn = orders * np.arctan2(y, x)[..., None]
        radius = 1 + np.cos(turn) @ wobble[0] + np.sin(turn) @ wobble[1]
        return np.asarray(size * np.maximum(radius, 0.3) - np.hypot(x, y))

    pieces, middle_of_band = bands.some(500), bands.centre(target)

    def covered(offset: float) -> float:
        x, y = (pieces.at - middle_of_band - offset * way).T
        inside = depth(x, y) > 0
        return max(pieces.share(k, inside) for k in (0, 1))

    far, near = 2.5 * size + bands.extent(target, way), 0.0
    for _ in range(12):
        middle = 0.5 * (far + near)
        far, near = (far, middle) if covered(middle) > share else (middle, near)
    centre = middle_of_band + far * way
    box = _box(light, centre, 2.2 * size)
    if box is None:
        return light, None
    x, y = _grid(box, centre)
    inside = depth(x, y)
    part = light[box]
    wet = 1 + 0.16 * np.sin(x * 0.21 + 9 * wobble[1, 0]) * np.sin(y * 0.26 + 9 * wobble[1, 1])
    round_off = 0.62 + 0.38 * np.clip(inside / (0.45 * size), 0, 1)
    colour = _DEBRIS[int(chance.integers(len(_DEBRIS)))] * (wet * round_off)[..., None]
    glint = np.exp(-((x / size + 0.25) ** 2 / 0.010 + (y / size + 0.30) ** 2 / 0.004))
    colour = colour + (150 * glint)[..., None]
    # A lump appears thinly, beside the band.
    thick = min(1.0, level / 0.15)
    opaque = (thick * np.clip(0.5 + inside / 1.6, 0, 1))[..., None].astype(np.float32)
    part += opaque * (colour.astype(np.float32) - part)
    hidden = np.zeros(light.shape[:2], dtype=bool)
    hidden[box] = (inside > 0) & (thick > 0.5)
    return light, hidden


def smoke(light: Light, _: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """A drifting veil, light = (1 - t) light + t veil; t up to 0.65, uneven over the picture."""
    height, width = light.shape[:2]
    amount = 0.5 + 0.5 * drift.wander("amount", 60)
    size = max(1, width // 6), max(1, height // 6)
    swirl = drift.clouds("swirl", *size, 3, 0.05)
    dense = np.clip(DENSEST * amount * (0.78 + 0.22 * swirl), 0, DENSEST)
    share = _enlarged(dense, light)
    # By planes: NumPy's broadcast over three channels took as long as drawing the scene.
    veil = cv2.merge([share * part for part in VEIL])
    return np.asarray(cv2.multiply(light, cv2.merge([1 - share] * 3)) + veil, np.float32), None


def _enlarged(coarse: Light, light: Light) -> Light:
    height, width = light.shape[:2]
    fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(fine, dtype=np.float32)


def _box(light: Light, centre: Floats, reach: float) -> tuple[slice, slice] | None:
    """The part of the picture within ``reach`` of a place; None where there is none."""
    height, width = light.shape[:2]
    left, top = (max(0, int(c - reach)) for c in centre)
    right, bottom = (
        min(size, int(c + reach) + 2) for size, c in zip((width, height), centre, strict=True)
    )
    return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None


def _grid(box: tuple[slice, slice], centre: Floats) -> tuple[Floats, Floats]:
    rows, columns = box
    x, y = np.meshgrid(
        np.arange(columns.start, columns.stop) - centre[0],
        np.arange(rows.start, rows.stop) - centre[1],
    )
    return x, y
