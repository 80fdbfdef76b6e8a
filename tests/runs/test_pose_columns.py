"""Poses to an axis; the oracle is SciPy's rotations."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation
from tautscope.runs.columns import list_columns
from tautscope.runs.pose_columns import find_axes, travel, turn
from tautscope.runs.tables import open_table, read_table

RNG = np.random.default_rng(2)
AXIS = np.array([2.0, -3.0, 6.0]) / 7
"""Its largest component is positive."""


@pytest.mark.parametrize("scale", [0.3, 2.0, 9.0])
def test_a_turn_about_an_axis_is_its_angle(scale: float) -> None:
    """Also of several revolutions, from any start, and with either sign of each quaternion."""
    angles = scale * np.sin(np.linspace(0, 20, 500))
    start = Rotation.from_quat(RNG.normal(size=4))
    turned = (start * Rotation.from_rotvec(angles[:, None] * AXIS)).as_quat()
    signs = RNG.choice([-1, 1], len(angles))[:, None]
    found = turn(signs * turned)
    assert found is not None
    np.testing.assert_allclose(found, angles - angles[0], atol=1e-9)


def test_the_turn_is_about_the_main_axis() -> None:
    """A wobble about the other axes changes it little; missing samples stay so."""
    angles = np.sin(np.linspace(0, 20, 500))
    wobble = Rotation.from_rotvec(0.02 * RNG.normal(size=(500, 3)))
    quaternions = (Rotation.from_rotvec(angles[:, None] * AXIS) * wobble).as_quat()
    quaternions[7] = np.nan
    quaternions[9] = 0
    found = turn(quaternions)
    assert found is not None
    assert np.flatnonzero(np.isnan(found)).tolist() == [7, 9]
    assert np.nanmax(np.abs(found - angles)) < 0.1


def test_numbers_of_other_lengths_are_no_quaternions() -> None:
    assert turn(np.array([[1.0, 0, 0, 1], [0, 1, 0, 1]])) is None


def test_travel_is_along_the_line_of_motion() -> None:
    way = 30 * np.sin(np.linspace(0, 20, 500))
    points = np.array([5.0, 6, 7]) + way[:, None] * AXIS + 1e-3 * RNG.normal(size=(500, 3))
    points[3] = np.nan
    expected = np.where(np.arange(500) == 3, np.nan, way - way[0])
    np.testing.assert_allclose(travel(points), expected, atol=0.01)


def test_titles_that_differ_in_the_last_letter_belong_together() -> None:
    titles = ["t", "tip_qw", "tip_qx", "tip_qy", "tip_qz", "X", "Y", "Z", "a_x", "a_y", "max"]
    assert list(find_axes(titles)) == [("tip_q", (2, 3, 4, 1)), ("", (5, 6, 7))]


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_tables_with_poses_have_turn_and_travel(ending: str, tmp_path: Path) -> None:
    angles = np.sin(np.linspace(0, 20, 100))
    x, y, z, w = Rotation.from_rotvec(angles[:, None] * AXIS).as_quat().T
    columns = {"motor": angles, "qx": x, "qy": y, "qz": z, "qw": w}
    frame = pl.DataFrame(columns | {"tip_x": 3 * angles, "tip_y": 4 * angles, "tip_z": 0 * angles})
    file = tmp_path / f"record.{ending}"
    getattr(frame, f"write_{ending}")(file)
    found = read_table(file, ["q_turn", "tip_travel"])
    np.testing.assert_allclose(found.columns["q_turn"], angles, atol=1e-9)
    np.testing.assert_allclose(found.columns["tip_travel"], 5 * angles, atol=1e-9)
    assert found.units == {"q_turn": "rad"}
    _, pairs, _ = list_columns(open_table(file))
    assert pairs[0][0] == "motor"
    assert not {("tip_x", "tip_travel"), ("tip_travel", "tip_x")} & set(pairs)


def test_pairs_are_proposed_for_numbers_of_any_size(tmp_path: Path) -> None:
    time = np.linspace(0, 20, 100)
    frame = pl.DataFrame({"a": 1e-99 * np.sin(time), "b": 1e99 * np.sin(time - 0.2)})
    frame.write_csv(tmp_path / "record.csv")
    assert list_columns(open_table(tmp_path / "record.csv"))[1] == [("a", "b")]
