"""No command of the loop is faster than the motors can be, which would refuse it."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_settings import drives_document
from tautscope import HysteresisReduction
from tautscope.config import Config, dump_config, from_document
from tautscope.dof import Dof
from tautscope.loop.construction import motor_speeds
from test_motor_rig import robot_document

MATRIX = [[1.0, 0.5], [-1.0, 0.0]]


def article(tmp_path: Path, speeds: tuple[float, float, float]) -> Config:
    drives: dict[str, Any] = drives_document(channel=str(tmp_path / "bus"))
    for dof, speed in zip(Dof, speeds, strict=True):
        drives[dof.label] = drives[dof.label] | {"speed_limit": speed}
    return from_document({"drives": drives, "control": {"period": drives["cycle"]}})


def pair(tmp_path: Path, **actuators: Any) -> Config:
    document = robot_document("serial", tmp_path, 2)
    names = {"names": ["joint_1", "joint_2"], "units": ["rad", "rad"]}
    return from_document(document | {"actuators": names | actuators})


def fastest(config: Config, amplitude: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Largest speed (n,) of the command under sines, behind a slack that is told."""
    loop, times = HysteresisReduction(config), np.arange(0, 12, config.control.period)
    rates = np.linspace(1.0, 1.3, len(amplitude))
    commands = [loop.step(center + amplitude * np.sin(rates * time), time) for time in times]
    return np.asarray(np.abs(np.diff(commands, axis=0)).max(axis=0) / config.control.period)


def test_a_command_is_no_faster_than_the_drives(tmp_path: Path) -> None:
    speeds = (0.03, 3.0, 1.5)
    slack = {f"{dof.label}.delta_plus": 0.8 * Config()[dof].expected_width for dof in Dof}
    config = article(tmp_path, speeds).replace(**slack)
    centre = np.array([config.experiment[dof].centre for dof in Dof])
    found = fastest(config, np.array([4e-3, 0.4, 0.2]), centre)
    assert (found <= speeds).all()
    assert (found > 0.99 * np.array(speeds)).all(), "the motors are used"
    usual = fastest(config.replace(drives=None), np.array([4e-3, 0.4, 0.2]), centre)
    assert (usual > speeds).all()


def test_motors_behind_a_matrix_are_fast_enough_together(tmp_path: Path) -> None:
    config = pair(tmp_path, matrix=MATRIX)
    assert config.drives is not None
    limits = np.array([config.drives[motor].speed_limit for motor in config.drives.all_motors])
    speeds = np.array(motor_speeds(config))
    worst = np.max([np.abs(MATRIX @ (speeds * signs)) for signs in product((-1, 1), repeat=2)], 0)
    assert (worst <= limits * (1 + 1e-12)).all()
    assert worst[0] == pytest.approx(limits[0]), "no slower than needed"


def test_without_known_motors_the_configured_speed_counts(tmp_path: Path) -> None:
    assert motor_speeds(Config()) == []
    assert motor_speeds(pair(tmp_path, map="math:sin")) == []


def test_the_speed_of_a_command_can_be_told(tmp_path: Path) -> None:
    document = robot_document("serial", tmp_path, 1)
    del document["drives"]
    document["dof"][0] |= {"delta_minus": -0.2, "delta_plus": 0.2}
    free, slow = (
        from_document({**document, "dof": [document["dof"][0] | own]})
        for own in ({}, {"command_speed": 0.9})
    )
    amplitude, centre = np.array([0.4]), np.zeros(1)
    assert fastest(free, amplitude, centre)[0] > 0.9
    assert 0.89 < fastest(slow, amplitude, centre)[0] <= 0.9
    assert "command_speed = 0.9" in dump_config(slow)
