"""Pictures of the assembly for README.md: `python rigs/desktop/pictures.py`."""

from __future__ import annotations

from pathlib import Path

import bought
import parameters as p
import phantom
import render
from assembly import assemble, printed
from build import MIDDLE
from build123d import Circle, Part, Pos, Rot, sweep

PLACE = Path(__file__).with_name("pictures")
SERVOS = ("insertion_servo", "rotation_servo", "bending_servo")
TUBES = ("inner_tube", "outer_tube")
BOUGHT = (
    *("rail", "block", "slider_block", "rear_bearing", "front_bearing", "swivel_bearing", "dowel"),
    *SERVOS,
    *TUBES,
)
UNIT = ("rail", "block", "slider_block", "carriage", "insertion_servo", "pinion", "tower")
UNIT += ("rotor", "collar", "rotation_servo", "servo_gear", "slider", "swivel", "bracket")
UNIT += ("bending_servo", "cam", "inner_tube")
Move = tuple[float, float, float]
STEPS: dict[str, tuple[tuple[str, ...], dict[str, Move]]] = {
    "1_carriage": (
        ("rail", "block", "slider_block", "carriage", "insertion_servo", "pinion"),
        {"carriage": (0, 0, 30), "insertion_servo": (0, 0, 65), "pinion": (25, 25, 5)},
    ),
    "2_slider": (
        (
            "rail",
            "block",
            "slider_block",
            "carriage",
            "slider",
            "swivel_bearing",
            "swivel",
            "dowel",
        ),
        {"slider": (0, 0, 30), "swivel_bearing": (-12, -30, 30), "swivel": (40, 0, 45)}
        | {"dowel": (0, 0, 55)},
    ),
    "3_rotation": (
        (
            *("carriage", "tower", "rear_bearing", "front_bearing", "rotor", "collar"),
            *("rotation_servo", "servo_gear"),
        ),
        {
            "tower": (0, 0, 20),
            "rear_bearing": (-30, 0, 20),
            "front_bearing": (30, 0, 20),
            "rotor": (65, 0, 20),
            "collar": (-55, 0, 20),
            "rotation_servo": (-60, -20, 20),
            "servo_gear": (40, -10, 20),
        },
    ),
    "4_bending": (
        (
            *("carriage", "tower", "bracket", "bending_servo", "cam", "slider", "slider_block"),
            *("dowel", "swivel_bearing", "swivel", "rotor", "collar", "block"),
        ),
        {"bracket": (0, 0, 45), "bending_servo": (0, 0, 75), "cam": (0, 0, 18)},
    ),
    "5_base": (
        ("base", "rack", "inlet", *UNIT, "outer_tube"),
        dict.fromkeys(UNIT, (0, 0, 55))
        | {"rack": (0, 20, 15), "inlet": (25, 0, 15), "outer_tube": (55, 0, 15)},
    ),
}
"""Steps of the assembly: parts, and how far each is moved away [mm]."""
VIEWS = {"3_rotation": (-20.0, 30.0), "2_slider": (-50.0, 24.0), "4_bending": (-110.0, 12.0)}


def colour(name: str) -> render.Colour:
    """The colour of a part."""
    if name in SERVOS:
        return render.SERVO
    if name in TUBES:
        return render.BRASS
    if name in BOUGHT:
        return render.BOUGHT
    still = ("base", "rack", "inlet", "tower", "bracket", "head", "drum", "joint")
    return render.PRINTED if name in still else render.MOVED


def tip() -> dict[str, Part]:
    """The instrument's tip, its parts drawn apart."""
    core = Pos(p.SECTION_LENGTH + 4, 0, 0)
    places = {"band_a": 20, "spacer": 25, "band_b": 30, "end": 35}
    found = {"section": printed("section"), "tip_core": core * printed("tip_core")}
    for name, away in places.items():
        found[name] = core * Pos(away + 4, 0, 0) * printed(name)
    sheath = Pos(0, 0, p.AXIS) * bought.tube((p.SHEATH, p.WIRE + 0.6), (-20, 2))
    return found | {"sheath": sheath}


def phantom_parts() -> dict[str, Part]:
    """Drum and head, the tube bent by 90 degrees."""
    quarter = phantom.bend(0, 0.25)
    place = Pos(p.BEND_RADIUS, 70, p.BEND_PITCH / 4) * Rot(0, 0, 90)
    x_axis = Pos(0, 0, p.AXIS)
    return {
        "drum": printed("drum"),
        "head": Pos(0, 0, -p.BEND_PITCH / 4) * place * printed("head"),
        "rail": sweep(phantom.across(quarter) * Circle(p.CHANNEL[0] / 2), path=quarter),
        "block": Pos(0, -p.BEND_RADIUS, 0) * x_axis * bought.tube(p.CHANNEL, (-70, 0)),
        "slider_block": place * x_axis * bought.tube(p.CHANNEL, (-70, p.CAMERA_BACK)),
        "bending_servo": place * phantom.camera_place() * bought.tube((p.CAMERA, 5.0), (-55, 0)),
    }


def main() -> None:
    """Draw every picture."""
    PLACE.mkdir(exist_ok=True)
    whole = assemble(*MIDDLE)
    mesh = {name: render.triangles(part) for name, part in whole.items()}
    render.picture([(mesh[name], colour(name)) for name in whole], PLACE / "rig.png")
    for step, (names, away) in STEPS.items():
        shown = [(mesh[name] + away.get(name, (0, 0, 0)), colour(name)) for name in names]
        azimuth, elevation = VIEWS.get(step, (-55.0, 28.0))
        render.picture(shown, PLACE / f"{step}.png", azimuth=azimuth, elevation=elevation)
    bands = {"band_a": (40, 170, 80), "band_b": (40, 170, 80), "sheath": render.BOUGHT}
    for name, parts in (("6_tip", tip()), ("7_phantom", phantom_parts())):
        shown = [(render.triangles(q), bands.get(n, colour(n))) for n, q in parts.items()]
        render.picture(shown, PLACE / f"{name}.png", size=(900, 420))


if __name__ == "__main__":
    main()
