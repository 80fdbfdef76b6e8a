"""Outlines of involute gears and of a rack, as faces in the plane z = 0."""

from __future__ import annotations

import math

from build123d import Face, Polyline, make_face

PRESSURE = math.radians(20)
_FLANK = 8
"""Points on each flank."""

Points = list[tuple[float, float]]


def polygon(points: Points) -> Face:
    """The face within a closed polygon."""
    return make_face(Polyline(*points, close=True)).face()


def gear(teeth: int, module: float, thinning: float) -> Face:
    """A spur gear about the origin with a tooth on the x axis; DIN 867, foot without fillets.

    A flank is the involute of the base circle r_b = r cos(alpha): at radius rho it lies at
    the angle psi - inv(acos(r_b / rho)) from the tooth's centre, with inv(a) = tan(a) - a and
    psi so that the tooth has half a pitch, less the thinning, on the pitch circle.
    """
    pitch = module * teeth / 2
    base, tip, root = pitch * math.cos(PRESSURE), pitch + module, pitch - 1.25 * module
    half = (math.pi * module / 2 - thinning) / (2 * pitch) + _involute(PRESSURE)
    start = max(base, root)
    flank = []
    for step in range(_FLANK):
        radius = start + (tip - start) * step / (_FLANK - 1)
        flank.append((radius, half - _involute(math.acos(min(base / radius, 1.0)))))
    if root < base:
        flank.insert(0, (root, flank[0][1]))
    points: Points = []
    for tooth in range(teeth):
        centre = 2 * math.pi * tooth / teeth
        lower = [(r, centre - angle) for r, angle in flank]
        upper = [(r, centre + angle) for r, angle in reversed(flank)]
        points += [(r * math.cos(a), r * math.sin(a)) for r, a in lower + upper]
    return polygon(points)


def rack(length: float, depth: float, module: float, thinning: float) -> Face:
    """A rack about x = 0 with its pitch line on y = 0, teeth towards -y, a gap at x = 0."""
    pitch = math.pi * module
    half = (pitch / 2 - thinning) / 2
    slope = math.tan(PRESSURE)
    root, tip = 1.25 * module, -module
    count = int(length / pitch / 2)
    points: Points = [(-length / 2, depth), (-length / 2, root)]
    for index in range(-count, count):
        centre = (index + 0.5) * pitch
        at_root, at_tip = half + root * slope, half + tip * slope
        points += [
            (centre - at_root, root),
            (centre - at_tip, tip),
            (centre + at_tip, tip),
            (centre + at_root, root),
        ]
    return polygon([*points, (length / 2, root), (length / 2, depth)])


def spiral_groove(start: float, end: float, lead: float, width: float) -> Face:
    """A groove of radius r(a) = start + lead a / 2 pi at the polar angle -a, round at both ends."""
    turn = (end - start) / lead * 2 * math.pi
    steps = 60

    def at(angle: float, side: float) -> tuple[float, float]:
        radius = start + lead * angle / (2 * math.pi)
        slope = math.atan2(lead / (2 * math.pi), radius)
        x, y = radius * math.cos(-angle), radius * math.sin(-angle)
        normal = slope - angle
        return x + side * math.cos(normal), y + side * math.sin(normal)

    angles = [turn * step / steps for step in range(steps + 1)]
    outside = [at(angle, width / 2) for angle in angles]
    inside = [at(angle, -width / 2) for angle in reversed(angles)]
    return polygon(outside + inside)


def _involute(angle: float) -> float:
    return math.tan(angle) - angle
