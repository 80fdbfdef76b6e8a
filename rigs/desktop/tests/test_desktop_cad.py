"""The solids of the desktop rig: valid, printable, free to move, in mesh."""

from __future__ import annotations

import struct
import tomllib
from itertools import combinations
from pathlib import Path

import numpy as np
import parameters as p
import pytest
from assembly import PRINTED, assemble, for_printing, printed
from build import build
from build123d import BoundBox, Part, Pos, import_step

LOW = (p.INSERTION[0], p.ROTATION[0], p.BENDING[0])
HIGH = (p.INSERTION[1], p.ROTATION[1], p.BENDING[1])
POSITIONS = [LOW, HIGH, (p.INSERTION[0], p.ROTATION[1], p.BENDING[1]), (23.7, -1.13, 0.9)]
CONFIG = Path(__file__).parents[3] / "python" / "tautscope" / "config" / "rigs" / "desktop.toml"
THINNEST = 0.5
"""Wall that can be printed [mm]."""
TOUCH = 1e-3
"""Volume that the intersection of touching faces may have by rounding [mm^3]."""


def common(first: Part, second: Part) -> float:
    """Volume that two parts share [mm^3]."""
    found = first.intersect(second)
    return 0.0 if found is None else sum(solid.volume for solid in found.solids())


def are_apart(first: BoundBox, second: BoundBox) -> bool:
    return any(
        min(getattr(first.max, axis), getattr(second.max, axis))
        <= max(getattr(first.min, axis), getattr(second.min, axis))
        for axis in "XYZ"
    )


@pytest.mark.parametrize("name", PRINTED)
def test_a_printed_part_is_one_valid_solid_on_the_bed(name: str) -> None:
    part = for_printing(name)
    assert len(part.solids()) == 1
    assert part.is_valid
    assert part.volume > 10
    bounds = part.bounding_box()
    assert max(bounds.size.X, bounds.size.Y) <= p.BED
    assert abs(bounds.min.Z) < 1e-6


@pytest.mark.parametrize("position", POSITIONS)
def test_no_two_parts_share_a_volume(position: tuple[float, float, float]) -> None:
    parts = assemble(*position)
    boxes = {name: part.bounding_box() for name, part in parts.items()}
    shared = {
        (first, second): volume
        for first, second in combinations(parts, 2)
        if not are_apart(boxes[first], boxes[second])
        and (volume := common(parts[first], parts[second])) > TOUCH
    }
    assert not shared


@pytest.mark.parametrize("position", POSITIONS)
def test_the_stages_are_driven(position: tuple[float, float, float]) -> None:
    # Parts that do not share a volume and are a gap apart at each position drive each other.
    parts = assemble(*position)
    backlash = p.MESH + p.THINNING
    assert parts["pinion"].distance_to(parts["rack"]) <= backlash
    assert parts["servo_gear"].distance_to(parts["rotor"]) <= backlash
    assert parts["cam"].distance_to(parts["dowel"]) <= p.SLIDE


@pytest.mark.parametrize(
    ("driver", "driven", "moved"),
    [
        ("pinion", "rack", (2.0, 0, 0)),
        ("servo_gear", "rotor", (0, 0.2, 0)),
        ("cam", "dowel", (0, 0, 0.4)),
    ],
)
def test_a_driver_that_stands_is_in_the_way(
    driver: str, driven: str, moved: tuple[float, float, float]
) -> None:
    here = (20.0, 0.5, 1.0)
    there = assemble(*np.add(here, moved))
    still = assemble(*here)
    # The pinion's axis moves with the carriage.
    standing = Pos(moved[0], 0, 0) * still[driver]
    assert common(standing, there[driven]) > 0.1


def test_the_blocks_stay_on_the_rail() -> None:
    for position in (LOW, HIGH, (LOW[0], 0, HIGH[2])):
        parts = assemble(*position)
        rail = parts["rail"].bounding_box()
        for name in ("block", "slider_block"):
            block = parts[name].bounding_box()
            assert rail.min.X <= block.min.X
            assert block.max.X <= rail.max.X


def test_the_stages_travel_as_far_as_the_configuration_says() -> None:
    low, high = assemble(*LOW), assemble(*HIGH)

    def moved(name: str, within: str) -> float:
        return sum(
            sign * (parts[name].center().X - parts[within].center().X)
            for sign, parts in ((1, high), (-1, low))
        )

    assert moved("block", "base") == pytest.approx(p.INSERTION[1] - p.INSERTION[0])
    # The wire is pulled while the bending increases.
    assert moved("slider_block", "block") == pytest.approx(-p.ARM * (p.BENDING[1] - p.BENDING[0]))


def test_the_groove_ends_beyond_the_travel() -> None:
    beyond = (p.CAM_MARGIN + p.SLIDE) / p.ARM + 0.1
    for end, sign in ((p.BENDING[0], -1), (p.BENDING[1], 1)):
        parts = assemble(0, 0, end + sign * beyond)
        assert common(parts["cam"], parts["dowel"]) > TOUCH


def test_the_bands_are_where_the_configuration_has_them() -> None:
    for name, centre in (("band_a", p.BAND_A), ("band_b", p.BAND_B)):
        bounds = printed(name).bounding_box()
        half = p.BAND_LENGTH / 2
        assert abs(bounds.min.X - (centre - half)) < 1e-6
        assert abs(bounds.max.X - (centre + half)) < 1e-6


def test_the_section_bends_as_far_as_the_experiment_wants() -> None:
    # A closed notch turns by its width over the distance from the spine to the far edge.
    largest = p.NOTCHES * p.NOTCH / (p.TIP_DIAMETER - p.SPINE / 2)
    wanted = tomllib.loads(CONFIG.read_text(encoding="utf-8"))["experiment"]["bending"]
    assert wanted["centre"] + wanted["amplitude"] <= largest
    wall = p.NOTCH_PITCH - p.NOTCH
    end = p.NOTCH_START + p.NOTCHES * p.NOTCH_PITCH - wall
    proximal, distal = p.COIL_SEATS
    assert min(wall, p.NOTCH_START - proximal) >= THINNEST
    assert end <= p.SECTION_LENGTH - distal


def test_files_have_the_solids(tmp_path: Path) -> None:
    build(tmp_path)
    for name in PRINTED:
        assert stl_volume(tmp_path / f"{name}.stl") == pytest.approx(printed(name).volume, rel=0.01)
    assert import_step(tmp_path / "cam.step").volume == pytest.approx(printed("cam").volume)
    solids = sum(len(part.solids()) for part in assemble(*LOW).values())
    assert len(import_step(tmp_path / "rig.step").solids()) == solids


def stl_volume(path: Path) -> float:
    """Volume within the triangles of a binary or text STL file, by the divergence theorem."""
    data = path.read_bytes()
    count = struct.unpack_from("<I", data, 80)[0]
    if len(data) == 84 + 50 * count:
        record = np.dtype([("floats", "<f4", 12), ("attribute", "<u2")])
        corners = np.frombuffer(data, record, count, 84)["floats"][:, 3:].reshape(-1, 3, 3)
    else:
        lines = [line.split()[1:] for line in data.decode().splitlines() if "vertex" in line]
        corners = np.array(lines, float).reshape(-1, 3, 3)
    a, b, c = corners.astype(float).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
