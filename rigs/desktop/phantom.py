"""Printed parts beyond the base: the instrument's tip, the channel's bend, the scope's head."""

from __future__ import annotations

import math

import parameters as p
from build123d import Edge, Helix, Location, Part, Plane, Pos, Rectangle, Rot, sweep
from shapes import box, rod

HEAD_LENGTH = 20.0
DRUM = p.BEND_RADIUS + 3
DRUM_ABOVE = 20.0
"""Height of the drum above the instrument's axis."""
CORE = (0, p.AXIS)


def section() -> Part:
    """The bending section, of TPU; x = 0 is its proximal end, its spine is below."""
    body = rod("x", (0, p.SECTION_LENGTH), CORE, p.TIP_DIAMETER)
    body -= rod("x", (-1, 30), CORE, p.WIRE + 0.6)
    proximal, distal = p.COIL_SEATS
    for seat in ((-1, proximal), (p.SECTION_LENGTH - distal, 30)):
        body -= rod("x", seat, CORE, p.SHEATH + 2 * p.PRESS)
    spine = p.AXIS - p.TIP_DIAMETER / 2 + p.SPINE
    for index in range(p.NOTCHES):
        x = p.NOTCH_START + p.NOTCH_PITCH * index
        body -= box((x, x + p.NOTCH), (-9, 9), (spine, 90))
    return body


def tip_core() -> Part:
    """The rigid tip, glued over the closed jaws and on the bending section's end at x = 0."""
    body = rod("x", (0, p.TIP_LENGTH), CORE, p.CORE_DIAMETER)
    body += rod("x", (0, p.BAND_A - p.BAND_LENGTH / 2), CORE, p.TIP_DIAMETER)
    return body - rod("x", (-1, p.TIP_LENGTH - 1), CORE, p.SHEATH + 2 * p.SLIDE)


def ring(low: float, high: float) -> Part:
    """A ring on the tip between two positions: a band, the spacer or the end."""
    span = (low, high)
    return rod("x", span, CORE, p.TIP_DIAMETER) - rod("x", span, CORE, p.CORE_DIAMETER + p.SLIDE)


def rings() -> dict[str, Part]:
    """The rings of the tip, by name."""
    half = p.BAND_LENGTH / 2
    return {
        "band_a": ring(p.BAND_A - half, p.BAND_A + half),
        "spacer": ring(p.BAND_A + half, p.BAND_B - half),
        "band_b": ring(p.BAND_B - half, p.BAND_B + half),
        "end": ring(p.BAND_B + half, p.TIP_LENGTH),
    }


def head() -> Part:
    """The scope's head: holds the channel, which stands out at x = 0, and the camera above."""
    body = box((-45, 10), (-30, 30), (0, 5))
    body += box((-HEAD_LENGTH, 0), (-10, 10), (0, p.AXIS + p.CAMERA_OFFSET + 15))
    body += box((-45, -HEAD_LENGTH), (-3, 3), (5, 30))
    body -= rod("x", (-60, 60), (0, p.AXIS), p.CHANNEL[0] + 2 * p.PRESS)
    body -= rod("y", (-20, 0), (-10, p.AXIS), p.M3_TAPPED)
    # A slot and a screw close the bore of the camera.
    closing = rod("x", (-60, 60), (0, 0), p.CAMERA + 2 * p.PRESS)
    closing += box((-60, 60), (0, 20), (-0.6, 0.6))
    closing += rod("z", (0, 30), (-10, 7.2), p.M3) + rod("z", (-9, 0), (-10, 7.2), p.M3_TAPPED)
    body -= camera_place() * closing
    for y in (-23.0, 23.0):
        body -= rod("z", (-1, 9), (-15, y), 4.5)
    return body


def camera_place() -> Location:
    """Place of the camera in the head: its front at the origin, looking along x."""
    return Pos(0, 0, p.AXIS + p.CAMERA_OFFSET) * Rot(0, math.degrees(p.CAMERA_TILT), 0)


def drum() -> Part:
    """The bend of the channel: a helical groove, into which the tube is laid.

    The tube enters along x where y is smallest; after each quarter turn it can leave.
    """
    height = p.AXIS + DRUM_ABOVE
    body = rod("z", (0, height), (0, 0), 2 * DRUM)
    body -= rod("z", (5, height + 1), (0, 0), 2 * DRUM - 20)
    width = p.CHANNEL[0] + 2 * p.SLIDE
    path = bend(-0.25, 1.25)
    profile = across(path) * Pos(6 - width / 2, 0) * Rectangle(12, width)
    body -= sweep(profile, path=path, is_frenet=True)
    for x in (-30.0, 30.0):
        body -= rod("z", (-1, 9), (x, 0), 4.5)
    return body


def bend(start: float, end: float) -> Edge:
    """The axis of the channel on the drum, from and to so many turns after its entry."""
    low = p.AXIS + start * p.BEND_PITCH
    turned = Rot(0, 0, -90 + 360 * start)
    return (
        Pos(0, 0, low) * turned * Helix(p.BEND_PITCH, (end - start) * p.BEND_PITCH, p.BEND_RADIUS)
    )


def across(path: Edge) -> Location:
    """The plane across the start of a bend, x outwards."""
    begin = path @ 0
    return Plane(origin=begin, x_dir=(begin.X, begin.Y, 0), z_dir=path % 0).location


def joint() -> Part:
    """The sleeve between outer tube and channel; x = 0 is where they meet."""
    size = max(p.OUTER_TUBE[0], p.CHANNEL[0])
    body = rod("x", (-10, 10), CORE, size + 6)
    return body - rod("x", (-20, 20), CORE, size + 2 * p.PRESS)
