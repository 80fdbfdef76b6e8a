"""The properties in which drawn instruments differ, their ranges, and the draw."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config, Profile, load_config

Floats = NDArray[np.float64]
DOMAIN = 1600
"""First part of the seed of every draw: no other benchmark draws from it."""
HALF_WIDTH = (5e-3, 0.9, 0.55)
"""Nominal half widths: those of the article's Table 1 [m, rad, rad]."""
SLACKENING = 11.0
"""Relative increase of the width of bending by a compliance of 1 mm/N, measured on the twin."""
LONGEST_READOUT = 0.03
"""Of a rolling shutter [s]."""


@dataclass(frozen=True, slots=True)
class Property:
    """A property with its range, in which it is uniformly distributed.

    Attributes:
        name: Unique; ending in the DOF if it belongs to one.
        low: Smallest value.
        high: Largest value.
        unit: Unit.
        what: Description.
        is_told: Whether it is an error of what the loop is told; otherwise of the instrument.
    """

    name: str
    low: float
    high: float
    unit: str
    what: str
    is_told: bool = False


def _per_dof(name: str, low: float, high: float, unit: str, what: str) -> list[Property]:
    dofs = ("insertion", "rotation", "bending")
    return [Property(f"{name} {dof}", low, high, unit, what) for dof in dofs]


def _per_part(name: str, low: float, high: float, unit: str, what: str) -> list[Property]:
    return [Property(f"{name} {part}", low, high, unit, what) for part in ("shaft", "section")]


TABLE = (
    *_per_dof("width", 0.5, 1.4, "nominal", "loop width"),
    *_per_dof("gain", 0.6, 1.2, "1", "tip travel over motor travel"),
    *_per_dof("asymmetry", -0.4, 0.4, "half width", "centre of the contact offsets"),
    *_per_dof("slack", 0.0, 0.4, "half width", "motor travel in mid-stroke that moves nothing"),
    *_per_dof("lag", 0.0, 0.1, "s", "time constant of the transmission"),
    Property("rounding shaft", 1.0, 4.0, "nominal", "compliance of the channel's wall"),
    Property("rounding section", 0.0, 0.3, "share", "spread of the friction over the joints"),
    *_per_part("over position", -0.3, 0.3, "share", "amplitude of the friction over position"),
    *_per_part("over time", 0.0, 0.3, "share", "amplitude of the friction over 40 s"),
    *_per_part("stick", 0.0, 0.3, "share", "friction at rest above that in motion"),
    Property("curvature linear", -0.8, 0.8, "share", "change of the curvature along the section"),
    Property("curvature quadratic", -0.8, 0.8, "share", "the same, quadratic"),
    Property("plane", -5.0, 5.0, "deg", "plane of bending"),
    Property("compliance", 0.0, 0.05, "mm/N", "shortening of the section under tension"),
    Property("frame rate", 15.0, 60.0, "Hz", "images per second"),
    Property("latency", 20.0, 250.0, "ms", "capture to arrival of an image"),
    Property("stamp error", -20.0, 20.0, "ms", "stamped minus true time of capture"),
    Property("readout", 0.0, 0.9, "period", "first to last row, at most 30 ms (rolling shutter)"),
    Property("exposure", 0.1, 1.0, "s", "time constant of the automatic exposure"),
    Property("brightness", 70.0, 140.0, "grey level", "mean that the exposure aims at"),
    Property("quality", 30.0, 95.0, "1", "quality of the MJPEG compression"),
    Property("told tilt", 0.0, 2.0, "deg", "camera pose: angle, about a random axis", True),
    Property("told shift", 0.0, 2.0, "mm", "camera pose: distance, in a random direction", True),
    Property("told focal length", -2.0, 2.0, "%", "focal lengths", True),
    Property("told centre x", -5.0, 5.0, "px", "principal point", True),
    Property("told centre y", -5.0, 5.0, "px", "principal point", True),
    Property("told section", -5.0, 5.0, "%", "length of the section", True),
    Property("told band A", -0.5, 0.5, "mm", "position of the band", True),
    Property("told band B", -0.5, 0.5, "mm", "position of the band", True),
)


@dataclass(frozen=True)
class DrawnInstrument:
    """An instrument, and what the loop is told about it.

    Attributes:
        seed: Of the draw.
        values: Value of each property of `TABLE`, in its unit.
        actual: Configuration of the twin.
        told: Configuration of the loop: another camera, pose and geometry.
    """

    seed: int
    values: dict[str, float]
    actual: Config
    told: Config


def draw_instrument(seed: int, profile: Profile = "best") -> DrawnInstrument:
    """Draw an instrument; the same seed gives the same one."""
    rng = np.random.default_rng([DOMAIN, seed])
    values = {each.name: float(rng.uniform(each.low, each.high)) for each in TABLE}
    axis, direction = (each / np.linalg.norm(each) for each in rng.standard_normal((2, 3)))
    nominal = load_config(profile=profile)
    actual = nominal.replace(**_instrument(values, nominal), **{"twin.seed": seed})
    return DrawnInstrument(seed, values, actual, _told(values, actual, axis, direction))


def _instrument(values: dict[str, float], nominal: Config) -> dict[str, object]:
    """Settings of the twin, by dotted path."""
    shaft, cables = nominal.twin.shaft, nominal.twin.cables

    def per_dof(name: str, units: tuple[float, ...] = (1.0, 1.0, 1.0)) -> tuple[float, ...]:
        dofs = ("insertion", "rotation", "bending")
        return tuple(unit * values[f"{name} {dof}"] for dof, unit in zip(dofs, units, strict=True))

    def per_part(name: str) -> tuple[float, float]:
        return values[f"{name} shaft"], values[f"{name} section"]

    # Widths are those of the command, so that a lower gain needs less friction for one.
    gains = per_dof("gain")
    insertion, rotation, bending = per_dof("width", gains)
    # Cables that slacken with the section widen the loop.
    bending /= 1 + SLACKENING * values["compliance"]
    # Insertion and rotation share the friction; a width is friction over stiffness.
    friction = (insertion * rotation) ** 0.5
    wall = values["rounding shaft"]
    rate = values["frame rate"]
    return {
        "twin.shaft.friction": shaft.friction * friction,
        "twin.shaft.axial_stiffness": shaft.axial_stiffness * friction / insertion,
        "twin.shaft.torsional_stiffness": shaft.torsional_stiffness * friction / rotation,
        "twin.shaft.liner_stiffness": tuple(each / wall for each in shaft.liner_stiffness),
        "twin.cables.friction": cables.friction * bending,
        "twin.cables.joint_friction": cables.joint_friction * bending,
        "twin.cables.slack": cables.slack * bending,
        "twin.cables.joint_spread": values["rounding section"],
        "twin.cables.curvature": (values["curvature linear"], values["curvature quadratic"]),
        "twin.cables.plane": float(np.deg2rad(values["plane"])),
        "twin.cables.compliance": 1e-3 * values["compliance"],
        "twin.transmission.gain": gains,
        "twin.transmission.offset": tuple(
            gain * each for gain, each in zip(gains, per_dof("asymmetry", HALF_WIDTH), strict=True)
        ),
        "twin.transmission.slack": per_dof("slack", HALF_WIDTH),
        "twin.transmission.lag": per_dof("lag"),
        "twin.friction.over_position": per_part("over position"),
        "twin.friction.over_time": per_part("over time"),
        "twin.friction.stick": per_part("stick"),
        "twin.frame_rate": rate,
        "twin.latency": 1e-3 * values["latency"],
        "twin.sensor.stamp_error": 1e-3 * values["stamp error"],
        "twin.sensor.readout": min(values["readout"] / rate, LONGEST_READOUT),
        "twin.sensor.exposure_time_constant": values["exposure"],
        "twin.sensor.exposure_target": values["brightness"],
        "twin.sensor.jpeg_quality": round(values["quality"]),
    }


def _told(values: dict[str, float], actual: Config, axis: Floats, direction: Floats) -> Config:
    camera, instrument = actual.camera, actual.instrument
    pose = camera.camera_from_guide
    turn, _ = cv2.Rodrigues(axis * np.deg2rad(values["told tilt"]))
    rotation, _ = cv2.Rodrigues(turn @ cv2.Rodrigues(np.array(pose.rotation))[0])
    shift = 1e-3 * values["told shift"] * direction
    focal = 1 + values["told focal length"] / 100
    return actual.replace(
        **{
            "camera.fx": camera.fx * focal,
            "camera.fy": camera.fy * focal,
            "camera.cx": camera.cx + values["told centre x"],
            "camera.cy": camera.cy + values["told centre y"],
            "camera.camera_from_guide.rotation": tuple(rotation.ravel().tolist()),
            "camera.camera_from_guide.translation": tuple(
                (np.array(pose.translation) + shift).tolist()
            ),
            "instrument.bending_length": instrument.bending_length
            * (1 + values["told section"] / 100),
            "instrument.marker_a": instrument.marker_a + 1e-3 * values["told band A"],
            "instrument.marker_b": instrument.marker_b + 1e-3 * values["told band B"],
        }
    )


def markdown_table() -> str:
    """The ranges as a Markdown table, properties that differ in their last word in one row."""
    found: dict[tuple[float, float, str, str], list[str]] = {}
    for p in TABLE:
        found.setdefault((p.low, p.high, p.unit, p.what), []).append(p.name)
    lines = ["| property | range | what |", "|---|--:|---|"]
    for (low, high, unit, what), (first, *others) in found.items():
        names = ", ".join([first, *(name.rpartition(" ")[2] for name in others)])
        lines.append(
            f"| {names} | {low:g} to {high:g} {unit.removesuffix('1')}".rstrip() + f" | {what} |"
        )
    return "\n".join(lines)
