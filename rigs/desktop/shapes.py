"""Boxes and cylinders by their ends."""

from __future__ import annotations

from build123d import Align, Box, Cylinder, Face, Part, Pos, Rot, extrude

LOW = (Align.MIN, Align.MIN, Align.MIN)
BOTTOM = (Align.CENTER, Align.CENTER, Align.MIN)
ALONG = {"x": Rot(0, 90, 0), "y": Rot(-90, 0, 0), "z": Rot(0, 0, 0)}
"""Rotations of the z axis to an axis."""

Span = tuple[float, float]


def box(x: Span, y: Span, z: Span) -> Part:
    """The box between two corners."""
    size = (x[1] - x[0], y[1] - y[0], z[1] - z[0])
    return Pos(x[0], y[0], z[0]) * Box(*size, align=LOW)


def rod(axis: str, span: Span, centre: tuple[float, float], diameter: float) -> Part:
    """A cylinder along an axis between two positions; `centre` has its other two coordinates."""
    low, high = sorted(span)
    first, second = centre
    place = {
        "x": Pos(low, first, second),
        "y": Pos(first, low, second),
        "z": Pos(first, second, low),
    }[axis]
    return place * ALONG[axis] * Cylinder(diameter / 2, high - low, align=BOTTOM)


def prism(face: Face, low: float, high: float) -> Part:
    """A face in the plane z = 0, extruded between two heights."""
    return Pos(0, 0, low) * extrude(face, amount=high - low)
