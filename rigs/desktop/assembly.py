"""The rig at a position of its stages: every part in its place."""

from __future__ import annotations

import math
from functools import cache

import bought
import parameters as p
import parts
import phantom
from build123d import Part, Pos, Rot

PRINTED = {
    "base": (parts.base, (0, 0, 0)),
    "rack": (parts.rack_bar, (0, 0, 0)),
    "inlet": (parts.inlet, (0, 90, 0)),
    "carriage": (parts.carriage, (0, 0, 0)),
    "pinion": (lambda: parts.pinion(p.PINION_TEETH), (180, 0, 0)),
    "tower": (parts.tower, (0, 90, 0)),
    "rotor": (parts.rotor, (0, 90, 0)),
    "collar": (parts.collar, (0, 90, 0)),
    "servo_gear": (lambda: parts.pinion(p.SERVO_GEAR_TEETH), (180, 0, 0)),
    "bracket": (parts.bracket, (180, 0, 0)),
    "cam": (parts.cam, (180, 0, 0)),
    "slider": (parts.slider, (0, 0, 0)),
    "swivel": (parts.swivel, (0, 90, 0)),
    "joint": (phantom.joint, (0, 90, 0)),
    "head": (phantom.head, (0, 0, 0)),
    "drum": (phantom.drum, (0, 0, 0)),
    "section": (phantom.section, (0, 90, 0)),
    "tip_core": (phantom.tip_core, (0, -90, 0)),
    **{
        name: ((lambda found=name: phantom.rings()[found]), (0, 90, 0))
        for name in ("band_a", "spacer", "band_b", "end")
    },
}
"""Printed parts: how each is made, and the rotation in which it is printed [degrees]."""


@cache
def printed(name: str) -> Part:
    """A printed part in the frame in which it is made."""
    return PRINTED[name][0]()


def for_printing(name: str) -> Part:
    """A printed part as it lies on the bed: turned, centred, lowest point at z = 0."""
    turned = Rot(*PRINTED[name][1]) * printed(name)
    bounds = turned.bounding_box()
    return Pos(-bounds.center().X, -bounds.center().Y, -bounds.min.Z) * turned


def assemble(insertion: float, rotation: float, bending: float) -> dict[str, Part]:
    """All parts of the base by name, at a position of the stages [mm, rad, rad].

    The teeth mesh as the parts turn: the pinion by insertion / radius, the servo's gear by half
    of the rotation, the cam so that its groove is at the pin.
    """
    on_carriage = Pos(p.HOME + insertion, 0, 0)
    on_slider = on_carriage * Pos(p.slider_x(bending), 0, 0)
    on_rail = Pos(0, 0, p.BASE_THICKNESS)
    down = Rot(180, 0, 0)
    insertion_face = p.PLATE_BOTTOM + p.SKIN
    pinion = Pos(0, p.PINION_Y, insertion_face - p.HORN_STAND) * down
    turned = math.degrees(insertion / p.PINION_RADIUS)
    servo_gear = parts.rotation_servo_place() * Pos(0, 0, p.HORN_STAND)
    half_tooth = 180 / p.SERVO_GEAR_TEETH
    cam = parts.bending_servo_place() * Pos(0, 0, p.HORN_STAND)
    groove = (p.pin_radius(bending) - p.CAM_START + p.CAM_MARGIN) / p.CAM_LEAD * 360
    rotor = Pos(0, 0, p.AXIS) * Rot(math.degrees(rotation), 0, 0) * Pos(0, 0, -p.AXIS)
    ratio = p.ROTOR_GEAR_TEETH / p.SERVO_GEAR_TEETH
    gear_turn = 90 + half_tooth - math.degrees(rotation) * ratio
    at_axis = on_carriage * Pos(0, 0, p.AXIS)
    tower_rear = p.TOWER[1] - 28
    return {
        "base": printed("base"),
        "rail": on_rail * Pos(p.RAIL_CENTRE, 0, 0) * bought.rail(),
        "rack": printed("rack"),
        "inlet": printed("inlet"),
        "block": on_carriage * on_rail * bought.block(),
        "carriage": on_carriage * printed("carriage"),
        "insertion_servo": on_carriage * Pos(0, p.PINION_Y, insertion_face) * down * bought.servo(),
        "pinion": on_carriage * pinion * Rot(0, 0, -90 - turned) * printed("pinion"),
        "tower": on_carriage * printed("tower"),
        "rear_bearing": at_axis * bought.bearing(tower_rear),
        "front_bearing": at_axis * bought.bearing(p.TOWER[1] - p.BEARING_WIDTH),
        "rotor": on_carriage * rotor * printed("rotor"),
        "collar": on_carriage * rotor * printed("collar"),
        "rotation_servo": on_carriage * parts.rotation_servo_place() * bought.servo(),
        "servo_gear": on_carriage * servo_gear * Rot(0, 0, gear_turn) * printed("servo_gear"),
        "bracket": on_carriage * printed("bracket"),
        "bending_servo": on_carriage * parts.bending_servo_place() * bought.servo(),
        "cam": on_carriage * cam * Rot(0, 0, groove) * printed("cam"),
        "slider_block": on_slider * on_rail * bought.block(),
        "slider": on_slider * printed("slider"),
        "swivel_bearing": on_slider * Pos(0, 0, p.AXIS) * bought.bearing(8),
        "swivel": on_slider * rotor * printed("swivel"),
        "dowel": on_slider * parts.dowel(),
        "inner_tube": at_axis * bought.tube(p.INNER_TUBE, (p.NOSE - 10, p.NOSE + 75)),
        "outer_tube": Pos(0, 0, p.AXIS) * bought.tube(p.OUTER_TUBE, (97, 177)),
    }
