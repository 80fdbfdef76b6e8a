"""A robot with [[dof]] whose motors are those of section [drives], on every protocol."""

import json
import math
import re
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from common.paths import ROOT
from drive_settings import drives_document
from servo_settings import MODELS, START, TIMES, servos_document
from tautscope import Tip, run_experiment
from tautscope.bench.any_motors import make_motors
from tautscope.cli import main
from tautscope.config import Config, dump_config, from_document, load_config
from tautscope.errors import ConfigError, SettingRefusedError, SignalError
from tautscope.hardware.doctor.drives import check_drives
from tautscope.hardware.motor_rig import MotorRig
from tautscope.loop.kinematics import TwoPlanes
from tautscope.report.operator_motion import motion_of
from tautscope.runs.recording import per_dof

PROTOCOLS = ["dynamixel", "feetech", "serial", "canopen"]
PATIENCE = "heartbeat_timeout = 2.0\nrequest_timeout = 2.0\nstate_timeout = 4.0"
"""For a busy computer."""
LANGUAGES = ("toml", "python")
SLACK = 0.1
"""Half width of the plays between servo and tip [rad]."""


def robot_document(protocol: str, folder: Path, count: int, **drives: Any) -> dict[str, Any]:
    """A robot of so many joints, each with a motor of its name."""
    motor: dict[str, Any] = {"travel": [-3.0, 3.0], "home": -math.pi}
    section: dict[str, Any] = {"protocol": protocol, "channel": str(folder / "bus"), **TIMES}
    if protocol == "canopen":
        article = drives_document(channel=str(folder / "bus"))
        motor = {**article["rotation"], "travel": [-3.0, 3.0]}
        section = {key: value for key, value in article.items() if not isinstance(value, dict)}
    elif protocol == "serial":
        motor |= {"counts_per_unit": 1000.0, "speed_limit": 10.0, "home": 0.0}
    else:
        motor |= {"model": MODELS[protocol]}
    names = [f"joint_{number}" for number in range(1, count + 1)]
    motors = {name: motor | {"node": at} for at, name in enumerate(names, start=1)}
    return {
        "dof": [{"name": name, "width_limit": 0.5, "range": [-1.0, 1.0]} for name in names],
        "control": {"period": section["cycle"]},
        "drives": section | {"motors": motors} | drives,
    }


class Arm(MotorRig):
    """Its tip follows the motors with play."""

    def __init__(self, config: Config) -> None:
        super().__init__(config)
        self.tip = np.zeros(len(config.dof))
        self.positions = self.tip

    def measure(self) -> Tip:
        self.tip = np.clip(self.tip, self.positions - SLACK, self.positions + SLACK)
        return Tip(self.tip, self.to_rig_time(time.monotonic()))

    def _sample(self, time: float, applied: np.ndarray) -> Any:
        self.positions = applied
        return super()._sample(time, applied)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_eight_motors_follow_the_loop(protocol: str, tmp_path: Path) -> None:
    config = from_document(robot_document(protocol, tmp_path, 8))
    assert config.drives is not None
    with ExitStack() as stack:
        motors = make_motors(config.drives, stack, start=np.full(8, 0.5))
        stack.enter_context(motors)
        assert {each.status for each in check_drives(config.drives)} <= {"ok", "note"}
        rig = Arm(config)
        try:
            sample = rig.reset()
            assert sample.applied == pytest.approx(np.zeros(8), abs=0.1), "the middle of range"
            motion = motion_of(config, seed=3, duration=3.0)
            recording = run_experiment(rig, motion, config)
        finally:
            rig.close()
    applied, command = (
        per_dof(recording.trace, group, config.dof) for group in ("applied", "command")
    )
    assert (np.ptp(applied, axis=0) > 0.1).all()
    assert np.abs(applied - command).max() < 0.5, "late by cycles of a busy computer at most"


def test_a_motor_by_its_name_ends_the_run(tmp_path: Path) -> None:
    document = robot_document("feetech", tmp_path, 4)
    document["drives"]["motors"]["joint_3"]["node"] = 9
    wrong = from_document(document)
    right = from_document(robot_document("feetech", tmp_path, 4))
    assert right.drives is not None
    with ExitStack() as stack:
        stack.enter_context(make_motors(right.drives, stack, start=np.zeros(4)))
        with pytest.raises(Exception, match=r"joint_3.*drives\.motors\.joint_3\.node"):
            Arm(wrong).reset()


def test_a_limit_of_the_microcontroller_is_named_with_the_motor_of_a_robot(tmp_path: Path) -> None:
    document = robot_document("serial", tmp_path, 2)
    right = from_document(document)
    far = {"counts_per_unit": 2.2e8, "travel": [-9.0, 0.0], "speed_limit": 4e-5}
    document["drives"]["motors"]["joint_2"] |= far
    assert right.drives is not None
    with ExitStack() as stack:
        stack.enter_context(make_motors(right.drives, stack, start=np.zeros(2)))
        with pytest.raises(SettingRefusedError, match=r"drives\.motors\.joint_2\.travel is"):
            Arm(from_document(document)).reset()


def test_it_is_written_and_read_back(tmp_path: Path) -> None:
    config = from_document(robot_document("dynamixel", tmp_path, 2))
    file = tmp_path / "robot.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    assert load_config(file) == config


def test_a_command_has_a_number_per_motor(tmp_path: Path) -> None:
    config = from_document(robot_document("serial", tmp_path, 2))
    with ExitStack() as stack:
        assert config.drives is not None
        stack.enter_context(make_motors(config.drives, stack, start=np.zeros(2)))
        rig = Arm(config)
        try:
            rig.reset()
            for wrong in (np.zeros(3), ["a", 0.0], [[0.0], [1.0, 2.0]]):
                with pytest.raises(SignalError, match="2 finite numbers"):
                    rig.step(wrong)
                rig.reset()
        finally:
            rig.close()


def test_the_articles_motors_stay_where_they_are(tmp_path: Path) -> None:
    drives = servos_document("dynamixel", tmp_path)
    config = from_document({"drives": drives, "control": {"period": drives["cycle"]}})
    with ExitStack() as stack:
        assert config.drives is not None
        stack.enter_context(make_motors(config.drives, stack, start=START))
        rig = MotorRig(config)
        try:
            assert rig.reset().applied == pytest.approx(START, abs=2e-3)
        finally:
            rig.close()


def test_motors_behind_a_matrix_start_where_it_says(tmp_path: Path) -> None:
    document = robot_document("serial", tmp_path, 2)
    document["dof"] = document["dof"][:1]
    names = ["joint_1", "joint_2"]
    pair = {"names": names, "units": ["rad", "rad"], "matrix": [[1.0], [-1.0]]}
    config = from_document(document | {"actuators": pair | {"offsets": [0.5, 0.5]}})
    assert Arm(config).start == pytest.approx([0.5, 0.5])


def _motors(document: dict[str, Any]) -> dict[str, Any]:
    motors: dict[str, Any] = document["drives"]["motors"]
    return motors


WRONG = {
    "order": ("drives.motors", lambda d: _motors(d).update(joint_1=_motors(d).pop("joint_1"))),
    "name": ("drives.motors", lambda d: _motors(d).update(elbow=_motors(d).pop("joint_2"))),
    "unit": ("drives.motors.joint_1.unit", lambda d: d["dof"][0].update(unit="m")),
    "node": ("drives.motors.joint_2.node", lambda d: _motors(d)["joint_2"].update(node=1)),
    "travel": ("drives.motors.joint_1.travel", lambda d: _motors(d)["joint_1"].update(travel=[1])),
    "model": ("drives.motors.joint_1.model", lambda d: _motors(d)["joint_1"].update(model="AX-12")),
    "both": ("drives.motors", lambda d: d["drives"].update(rotation=_motors(d)["joint_1"])),
    "none": ("drives.insertion", lambda d: d["drives"].pop("motors")),
    "no dof": ("drives", lambda d: d.pop("dof")),
    "table": ("drives.motors", lambda d: d["drives"].update(motors=[1])),
    "entry": ("drives.motors", lambda d: _motors(d).update(joint_1=3)),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_motors_are_named(name: str, tmp_path: Path) -> None:
    field, change = WRONG[name]
    document = robot_document("feetech", tmp_path, 2)
    change(document)
    with pytest.raises(ConfigError) as error:
        from_document(document)
    assert str(error.value).startswith(f"{field}"), error.value


class Tracker:
    """Its pose is that of a tip behind plays, in place of the tracker of docs/robots.md."""

    def __init__(self, config: Config) -> None:
        self._kinematics = TwoPlanes(config)
        self._tip = np.zeros(2)
        self._is_new = False

    def move(self, demand: np.ndarray) -> np.ndarray:
        self._tip = np.clip(self._tip, demand - 3 * SLACK, demand + 3 * SLACK)
        self._is_new = True
        return demand

    def newest(self) -> Any:
        if not self._is_new:
            return None
        self._is_new = False
        position, rotation = self._kinematics.tip(self._tip)
        return SimpleNamespace(position=position, quaternion=rotation, time=time.monotonic())


@pytest.mark.usefixtures("undrawn")
def test_the_robot_of_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (ROOT / "docs/robots.md").read_text(encoding="utf-8").partition("### Motors on a bus")[2]
    toml, code = (re.findall(rf"```{kind}\n(.*?)```", page, re.DOTALL)[0] for kind in LANGUAGES)
    toml = toml.replace("[drives]", f'[drives]\nchannel = "{tmp_path / "bus"}"\n{PATIENCE}')
    (tmp_path / "robot.toml").write_text(toml, encoding="utf-8")
    (tmp_path / "rig_of_the_page.py").write_text(code, encoding="utf-8")
    config = load_config(tmp_path / "robot.toml")
    tracker = Tracker(config)
    module = SimpleNamespace(tracker=tracker)
    monkeypatch.setitem(sys.modules, "my_tracker", module)  # type: ignore[arg-type]
    monkeypatch.chdir(tmp_path)
    assert config.drives is not None
    with ExitStack() as stack:
        stack.enter_context(make_motors(config.drives, stack, tracker.move, start=np.zeros(2)))
        rig = ["--rig", "rig_of_the_page:Arm", "--config", "robot.toml"]
        main(["doctor", *rig, "--yes", "--json"])  # a busy computer is a finding of its own
        findings = json.loads(capsys.readouterr().out)["findings"]
        of_bus = {one["what"]: one["status"] for one in findings if one["group"] == "drives"}
        assert of_bus["bend_y, servo 2"] == of_bus["bend_y, servo 2: settings"] == "ok"
        assert main(["run", *rig, "--yes", "--json", "--seconds", "5", "--out", "out"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["dof"]) == ["bend_x", "bend_y"]
    errors = [dof["uncompensated_rms"] for dof in found["dof"].values()]
    assert all(0.05 < error < SLACK * 3.5 for error in errors), "half a slack of 0.6 at most"
