"""Bought parts, as the space that they take."""

from __future__ import annotations

import parameters as p
from build123d import Part
from shapes import box, rod


def servo() -> Part:
    """A servo with its axis on z, its face at z = 0, the horn towards +z, its case towards -x.

    With the heads of its screws, on a plate of thickness `SKIN`.
    """
    half = p.SERVO_WIDTH / 2
    case = box((-p.SERVO_BEHIND, p.SERVO_AHEAD), (-half, half), (-p.SERVO_DEPTH, 0))
    rear = rod("z", (-p.SERVO_DEPTH - p.SERVO_REAR, -p.SERVO_DEPTH), (0, 0), 2 * p.HORN_RADIUS)
    horn = rod("z", (0, p.HORN_STAND), (0, 0), 2 * p.HORN_RADIUS)
    end = p.HORN_STAND + p.HORN_BOLT[1]
    bolt = rod("z", (p.HORN_STAND, end), (0, 0), 2 * p.HORN_BOLT[0])
    heads = [
        rod("z", (p.SKIN, p.SKIN + 1.6), (-along, sign * side), 3.8)
        for along, side in p.FACE_SCREWS
        for sign in (-1, 1)
    ]
    return case + rear + horn + bolt + heads


def rail() -> Part:
    """The rail, its bottom at z = 0."""
    half, length = p.RAIL_WIDTH / 2, p.RAIL_LENGTH / 2
    return box((-length, length), (-half, half), (0, p.RAIL_HEIGHT))


def block() -> Part:
    """A block of the guide about x = 0, over the bottom of its rail."""
    half, length = p.BLOCK_WIDTH / 2, p.BLOCK_LENGTH / 2
    body = box((-length, length), (-half, half), (p.BLOCK_GAP, p.GUIDE_HEIGHT))
    return body - box((-50, 50), (-6.1, 6.1), (0, p.RAIL_HEIGHT + 0.1))


def bearing(x: float) -> Part:
    """A bearing on the x axis, from x on."""
    span = (x, x + p.BEARING_WIDTH)
    return rod("x", span, (0, 0), p.BEARING_OUTSIDE) - rod("x", span, (0, 0), p.BEARING_BORE)


def tube(size: tuple[float, float], span: tuple[float, float]) -> Part:
    """A tube on the x axis."""
    return rod("x", span, (0, 0), size[0]) - rod("x", span, (0, 0), size[1])
