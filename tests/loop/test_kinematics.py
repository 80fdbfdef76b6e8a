"""Kinematics of bending sections against an integrated curve, rotations against SciPy."""

import copy
import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from tautscope.config import Config, from_document, to_document
from tautscope.errors import ConfigError
from tautscope.loop.kinematics import TwoPlanes, build_kinematics, rotation_matrix, rotation_vector
from tautscope.loop.measurement import check_rotation

CONFIG = from_document(
    {
        "dof": [
            {"name": "insertion", "unit": "m", "width_limit": 0.01},
            {"name": "bend_x", "width_limit": 1.0},
            {"name": "bend_y", "width_limit": 1.0},
            {"name": "rotation", "width_limit": 1.0},
        ],
        "kinematics": {"kind": "two_planes", "length": 0.05, "tip_length": 0.02},
    }
)


@pytest.mark.parametrize(
    "q",
    [
        (0.03, 0.0, 0.0, 0.0),
        (0.0, 1e-6, -2e-6, 0.4),
        (0.01, 9e-5, 4e-5, 1.0),
        (0.02, 0.7, -1.1, -0.6),
        (0.0, -2.0, 1.5, 2.0),
    ],
)
def test_two_planes_is_the_integral_of_a_constant_curvature(q: tuple[float, ...]) -> None:
    insertion, bend_x, bend_y, rotation = q
    end, frame = integrated(np.zeros(3), np.eye(3), bend_x, bend_y)
    about = Rotation.from_rotvec([0, 0, rotation]).as_matrix()
    place = about @ (end + frame[:, 2] * 0.02 + [0, 0, insertion])
    position, orientation = TwoPlanes(CONFIG).tip(np.array(q))
    np.testing.assert_allclose(position, place, atol=1e-9)
    np.testing.assert_allclose(orientation, about @ frame, atol=1e-8)


def integrated(
    start: np.ndarray, turned: np.ndarray, bend_x: float, bend_y: float
) -> tuple[np.ndarray, np.ndarray]:
    """End and frame of a section of 0.05 m that begins at a frame."""
    turn = np.array([-bend_y, bend_x, 0.0]) / 0.05

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        frame = y[3:].reshape(3, 3)
        cross = np.cross(np.eye(3), turn)
        return np.concatenate([frame[:, 2], (frame @ cross).ravel()])

    begin = np.concatenate([start, turned.ravel()])
    end = solve_ivp(slope, (0, 0.05), begin, rtol=1e-11, atol=1e-13).y[:, -1]
    return end[:3], end[3:].reshape(3, 3)


@pytest.mark.parametrize(
    "q", [(0.0, 0.0), (0.7, -1.1, 0.0, 0.0, -2.0, 1.5), (0.4, 0.2, 9e-5, 4e-5, 0.3, -0.8, 1.0, 0.1)]
)
def test_segments_are_the_integral_of_constant_curvatures(q: tuple[float, ...]) -> None:
    config = segments(len(q))
    end, frame = np.zeros(3), np.eye(3)
    for bend_x, bend_y in np.reshape(q, (-1, 2)):
        end, frame = integrated(end, frame, bend_x, bend_y)
    position, orientation = build_kinematics(config).tip(np.array(q))
    np.testing.assert_allclose(position, end + frame[:, 2] * 0.02, atol=1e-8)
    np.testing.assert_allclose(orientation, frame, atol=1e-8)


@pytest.mark.parametrize("kind", ["two_planes", "segments"])
def test_a_gripper_does_not_move_the_tip(kind: str) -> None:
    dofs = [{"name": name, "width_limit": 1.0} for name in ("bend_x", "grip", "bend_y")]
    document = {"dof": dofs, "kinematics": {"kind": kind, "without": ["grip"]}}
    others = {"dof": dofs[::2], "kinematics": {"kind": kind}}
    found = build_kinematics(from_document(document)).tip(np.array([0.4, 7.0, -0.3]))
    expected = build_kinematics(from_document(others)).tip(np.array([0.4, -0.3]))
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_placed_kinematics_can_be_copied_and_pickled() -> None:
    document = to_document(segments(4)) | {}
    document["kinematics"]["base_position"] = [0.1, 0.2, 0.3]
    placed, q = build_kinematics(from_document(document)), np.array([0.4, -0.3, 0.2, 0.1])
    for other in (copy.copy(placed), copy.deepcopy(placed), pickle.loads(pickle.dumps(placed))):
        for one, expected in zip(other.tip(q), placed.tip(q), strict=True):
            np.testing.assert_array_equal(one, expected)
    assert not hasattr(placed, "points")


def test_segments_have_two_degrees_of_freedom_each() -> None:
    with pytest.raises(ConfigError, match="two degrees of freedom per segment"):
        build_kinematics(segments(3))


def segments(count: int) -> Config:
    dofs = [{"name": f"bend_{index}", "width_limit": 1.0} for index in range(count)]
    kinematics = {"kind": "segments", "length": 0.05, "tip_length": 0.02}
    return from_document({"dof": dofs, "kinematics": kinematics})


@pytest.mark.parametrize("size", [0.0, 1e-7, 1e-4, 0.3, 2.0, 3.0, np.pi - 1e-4, np.pi - 1e-7])
def test_rotations_are_those_of_scipy(size: float) -> None:
    vector = size * np.array([2.0, -1.0, 2.0]) / 3
    oracle = Rotation.from_rotvec(vector)
    np.testing.assert_allclose(rotation_matrix(vector), oracle.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotation_vector(oracle.as_matrix()), vector, atol=1e-9)
    np.testing.assert_allclose(check_rotation(oracle.as_quat()), oracle.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("axis", [*np.eye(3), np.array([2.0, -1.0, 2.0]) / 3])
def test_half_a_turn_is_not_taken_for_none(axis: np.ndarray) -> None:
    found = rotation_vector(rotation_matrix(np.pi * axis))
    assert np.linalg.norm(found) == pytest.approx(np.pi)
    assert abs(found @ axis) == pytest.approx(np.pi)
