"""Printed parts on the carriage and the base, in the frame of the carriage or the base."""

from __future__ import annotations

import math

import parameters as p
from build123d import Part, Plane, Pos, Rot
from gears import gear, rack, spiral_groove
from shapes import box, prism, rod

COLLAR = 8.0
FOOT = 4.0


def servo_cut(along: Rot) -> Part:
    """What a plate loses for a servo with its face at z = 0 and its axis on z, before `along`."""
    half, ends = p.SERVO_WIDTH / 2 + p.POCKET, p.POCKET
    pocket = box((-p.SERVO_BEHIND - ends, p.SERVO_AHEAD + ends), (-half, half), (-20, 0))
    cut = pocket + rod("z", (-1, p.SKIN + 1), (0, 0), 2 * p.HORN_RADIUS + 3)
    for screw, side in p.FACE_SCREWS:
        for sign in (-1, 1):
            cut += rod("z", (-1, p.SKIN + 1), (-screw, sign * side), p.M2)
    return along * cut


def horn_mount(thickness: float, hub_end: float, screw: float) -> Part:
    """Holes of a gear or cam on z that lies on a horn at z = 0 and reaches to `hub_end`.

    The screws end 2.3 mm within the horn; their heads are countersunk by the rest.
    """
    cut = rod("z", (-1, p.HORN_BOLT[1] + 0.4), (0, 0), 2 * p.HORN_BOLT[0] + 0.6)
    head = screw - 2.3
    for quarter in range(4):
        angle = math.radians(45 + 90 * quarter)
        centre = (p.HORN_SCREWS * math.cos(angle), p.HORN_SCREWS * math.sin(angle))
        cut += rod("z", (-1, thickness + hub_end), centre, 3.2)
        cut += rod("z", (head, thickness + hub_end + 1), centre, 5.7)
    return cut


def pinion(teeth: int) -> Part:
    """A gear on a horn at z = 0, its axis on z, a tooth on the x axis."""
    wheel = prism(gear(teeth, p.MODULE, p.THINNING), p.HUB, p.HUB + p.GEAR_WIDTH)
    wheel += rod("z", (0, p.HUB), (0, 0), 2 * p.HORN_RADIUS)
    return wheel - horn_mount(p.GEAR_WIDTH, p.HUB, 10.0)


def cam() -> Part:
    """The spiral cam on a horn at z = 0; its groove opens to +z."""
    thickness = p.CAM_THICKNESS
    disc = rod("z", (0, p.HUB), (0, 0), 2 * p.HORN_RADIUS)
    disc += rod("z", (p.HUB, p.HUB + thickness), (0, 0), 2 * p.CAM_RADIUS)
    end = p.pin_radius(p.BENDING[1]) + p.CAM_MARGIN
    groove = spiral_groove(p.CAM_START - p.CAM_MARGIN, end, p.CAM_LEAD, p.DOWEL + p.SLIDE)
    top = p.HUB + thickness
    return disc - prism(groove, top - p.CAM_GROOVE, top + 1) - horn_mount(thickness, p.HUB, 8.0)


def base() -> Part:
    """The base plate with holes for rail, rack and inlet."""
    low, high = 0.0, p.BASE_THICKNESS
    plate = box((-105, 105), (-32, 75), (low, high))
    first = p.RAIL_CENTRE - p.RAIL_LENGTH / 2 + 12.5
    for index in range(8):
        x = first + p.RAIL_PITCH * index
        plate -= rod("z", (-1, 9), (x, 0), p.M3)
        plate -= _nut(x, 0)
    for x in (-9.0, 41.0):
        slot = box((x - p.M3 / 2, x + p.M3 / 2), (60.5, 65.5), (-1, 9))
        plate -= slot + box((x - 4, x + 4), (57, 69), (-1, 3.3))
    for y in (-10.0, 10.0):
        plate -= rod("z", (-1, 9), (101, y), p.M3) + rod(
            "z", (-1, p.M3_HEAD_HEIGHT), (101, y), p.M3_HEAD
        )
    for x in (-60.0, 60.0):
        plate -= rod("z", (-1, 9), (x, -24), 4.5)
    return plate


def rack_bar() -> Part:
    """The rack, in the frame of the base."""
    face = rack(p.RACK_LENGTH, 12.0, p.MODULE, p.THINNING)
    # A gap lies where a tooth of the pinion points to the rack at insertion 0.
    pitch = math.pi * p.MODULE
    x = p.HOME + round(sum(p.INSERTION) / 2 / pitch) * pitch
    y = p.PINION_Y + p.PINION_RADIUS + p.MESH
    bar = Pos(x, y, 0) * prism(face, p.BASE_THICKNESS, p.PLATE_BOTTOM - 2)
    for hole in (-9.0, 41.0):
        bar -= rod("z", (0, p.BASE_THICKNESS + 7), (hole, 63), p.M3_INSERT)
    return bar


def inlet() -> Part:
    """The holder of the outer tube, at the distal end of the base."""
    post = box((97, 105), (-15, 15), (p.BASE_THICKNESS, 22))
    post += box((97, 105), (-8, 8), (p.BASE_THICKNESS, p.AXIS + 9))
    post -= box((90, 110), (-6.5, 6.5), (0, p.BASE_THICKNESS + p.RAIL_HEIGHT + 0.5))
    post -= rod("x", (90, 110), (0, p.AXIS), p.OUTER_TUBE[0] + 2 * p.PRESS)
    post -= rod("z", (p.AXIS, 60), (101, 0), p.M3_TAPPED)
    for y in (-10.0, 10.0):
        post -= rod("z", (0, p.BASE_THICKNESS + 8), (101, y), p.M3_INSERT)
    return post


def carriage() -> Part:
    """The plate on the distal block, in the frame of the carriage."""
    low, high = p.PLATE_BOTTOM, p.PLATE_TOP
    plate = box((-24, 14), (-50, 34), (low, high)) + box((-42, 14), (30, 62), (low, high))
    plate -= _block_holes(low, high)
    for x, y in TOWER_SCREWS + BRACKET_SCREWS:
        plate -= rod("z", (0, 50), (x, y), p.M3) + rod(
            "z", (0, low + p.M3_HEAD_HEIGHT), (x, y), p.M3_HEAD
        )
    # The servo stands on the plate with its horn down.
    face = Pos(0, p.PINION_Y, low + p.SKIN) * Rot(180, 0, 0)
    return plate - servo_cut(face)


TOWER_SCREWS = ((-16.0, -44.0), (-16.0, -30.0), (-9.0, 26.5), (1.0, 26.5))
BRACKET_SCREWS = ((-18.0, -19.5), (-0.5, -19.5), (-18.0, 19.5), (-0.5, 19.5))


def tower() -> Part:
    """Bearings of the rotor and the servo of rotation, in the frame of the carriage."""
    low, high = p.TOWER
    foot = (p.PLATE_TOP, p.PLATE_TOP + FOOT)
    wall = box(p.TOWER, (-53, 31), (p.PLATE_TOP, p.AXIS + 16))
    wall += box(p.TOWER, (-53, -19), (p.PLATE_TOP, p.AXIS + 38))
    wall += box((-20, low), (-49, -24), foot) + box((-14, low), (23.4, 31), foot)
    # Gussets between the feet and the wall.
    wall += box((-14, low), (29, 31), (p.PLATE_TOP, p.PLATE_TOP + 16))
    rear = high - 28
    wall += rod("x", (rear, low), (0, p.AXIS), 30)
    wall -= rod("x", (-50, 50), (0, p.AXIS), p.BEARING_OUTSIDE - 4)
    seat = p.BEARING_OUTSIDE + 2 * p.PRESS
    wall -= rod("x", (high - p.BEARING_WIDTH, 50), (0, p.AXIS), seat)
    wall -= rod("x", (-50, rear + p.BEARING_WIDTH), (0, p.AXIS), seat)
    for x, y in TOWER_SCREWS:
        wall -= rod("z", (0, foot[1]), (x, y), p.M3_INSERT)
    return wall - servo_cut(rotation_servo_place())


def rotation_servo_place() -> Pos:
    """Place of the servo of rotation: its axis along +x, its case upwards."""
    face = p.TOWER[1] - p.SKIN
    return Plane(
        origin=(face, -p.GEAR_DISTANCE, p.AXIS), x_dir=(0, 0, -1), z_dir=(1, 0, 0)
    ).location


def rotor() -> Part:
    """The hollow shaft that turns the sheath: clamp, gear, two seats; teeth towards -y."""
    front = p.TOWER[1]
    start = front + p.HEADS
    wheel = Plane(origin=(start, 0, p.AXIS), x_dir=(0, -1, 0), z_dir=(1, 0, 0)).location * prism(
        gear(p.ROTOR_GEAR_TEETH, p.MODULE, p.THINNING), 0, p.GEAR_WIDTH
    )
    axis = (0, p.AXIS)
    shaft = wheel + rod("x", (p.ROTOR_REAR, start), axis, p.BEARING_BORE - 2 * p.PRESS)
    shaft += rod("x", (front, start), axis, 13) + rod("x", (start, p.NOSE), axis, 14)
    shaft -= rod("x", (-50, 50), axis, p.INNER_TUBE[0] + 2 * p.PRESS)
    nose = (start + p.GEAR_WIDTH, p.NOSE)
    middle = (nose[0] + nose[1]) / 2 + 0.5
    shaft -= box((nose[0] + 1, 50), (-0.6, 0.6), (p.AXIS, 90))
    shaft -= rod("y", (-20, 20), (middle, p.AXIS + 4), p.M3_TAPPED)
    return shaft - rod("y", (-20, -0.6), (middle, p.AXIS + 4), p.M3)


def collar() -> Part:
    """The clamp behind the rear bearing that keeps the rotor."""
    axis, end = (0, p.AXIS), p.TOWER[1] - 28
    ring = rod("x", (end - COLLAR, end - 1), axis, 22) + rod("x", (end - 1, end), axis, 13)
    ring -= rod("x", (-50, 50), axis, p.BEARING_BORE + 2 * p.PRESS)
    ring -= box((-50, 50), (-0.6, 0.6), (p.AXIS, 90))
    x = end - COLLAR / 2 - 0.5
    ring -= rod("y", (-20, 20), (x, p.AXIS + 8), p.M3_TAPPED)
    return ring - rod("y", (-20, -0.6), (x, p.AXIS + 8), p.M3)


def bracket() -> Part:
    """The bridge over the slider that carries the servo of bending, in the carriage's frame."""
    face = bending_face()
    bottom = face - p.SKIN
    top = (bottom, bottom + 6)
    bridge = box((-64, 4), (-23, 23), top)
    for sides in ((-23, -16), (16, 23)):
        bridge += box((-22, 4), sides, (p.PLATE_TOP, bottom))
        for x, y in BRACKET_SCREWS:
            bridge -= rod("z", (0, p.PLATE_TOP + 8), (x, y), p.M3_INSERT)
    return bridge - servo_cut(bending_servo_place())


def bending_face() -> float:
    """Height of the face of the servo of bending."""
    return p.CAM_BOTTOM + p.CAM_THICKNESS + p.HUB + p.HORN_STAND


def bending_servo_place() -> Pos:
    """Place of the servo of bending: its axis downwards, its case towards +x."""
    return Plane(origin=(p.CAM_X, 0, bending_face()), x_dir=(-1, 0, 0), z_dir=(0, 0, -1)).location


def slider() -> Part:
    """Bearing of the swivel and pin on the proximal block, in the frame of that block."""
    low, high = p.PLATE_BOTTOM, p.PLATE_TOP
    body = box((-22, 22), (-15, 15), (low, high)) - _block_holes(low, high)
    body += box((8, 16), (-15, 15), (high, p.AXIS + 13))
    body += box((p.PIN_X - 6, p.PIN_X + 6), (-6, 6), (high, p.CAM_BOTTOM - 1))
    body += box((p.PIN_X, 10), (-5, 5), (high, high + 4))
    body -= rod("x", (-1, 14), (0, p.AXIS), p.BEARING_OUTSIDE + 2 * p.PRESS) & box(
        (8, 14), (-15, 15), (0, 90)
    )
    body -= rod("x", (8, 20), (0, p.AXIS), 17)
    for y in (-9.5, 9.5):
        for z in (p.AXIS - 9.5, p.AXIS + 9.5):
            body -= rod("x", (7, 17), (y, z), p.M3_TAPPED)
    # The key for the swivel's screw reaches it through the post of the pin.
    body -= rod("x", (p.PIN_X - 9, p.PIN_X + 9), (0, p.AXIS), 6)
    return body - dowel()


def dowel() -> Part:
    """The dowel pin 3 x 12 in the slider, bought."""
    low = p.CAM_BOTTOM + p.CAM_GROOVE - 0.5 - 12
    return rod("z", (low, low + 12), (p.PIN_X, 0), p.DOWEL - 2 * p.PRESS)


def swivel() -> Part:
    """The wire's clamp, which turns with the instrument, in the frame of the slider."""
    axis = (0, p.AXIS)
    turned = rod("x", (8.3, 14), axis, p.BEARING_BORE - 2 * p.PRESS)
    turned += rod("x", (14, 16.5), axis, 13) + rod("x", (16.5, 26), axis, 14)
    turned -= rod("x", (14.5, 30), axis, p.WIRE + 0.4)
    turned -= rod("x", (0, 14), axis, p.M4_TAPPED)
    for x in (19.0, 23.5):
        turned -= rod("z", (p.AXIS, 60), (x, 0), p.M3_TAPPED)
    return turned


def _nut(x: float, y: float) -> Part:
    return rod("z", (-1, 2.7), (x, y), p.M3_NUT / math.cos(math.pi / 6))


def _block_holes(low: float, high: float) -> Part:
    holes = []
    for x in (-p.BLOCK_SCREWS, p.BLOCK_SCREWS):
        for y in (-p.BLOCK_SCREWS, p.BLOCK_SCREWS):
            holes.append(rod("z", (low - 1, high + 1), (x, y), p.M3))
            holes.append(rod("z", (low + 2.8, high + 30), (x, y), p.M3_HEAD))
    return Part() + holes
