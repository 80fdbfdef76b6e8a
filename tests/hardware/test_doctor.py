"""`tautscope doctor` with a rig, a wrong one, and none; no drive is ever enabled."""

import json
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from drive_settings import AXES, EXPERIMENT, drives_document
from tautscope.bench.can_bus import Hub
from tautscope.bench.drives import SimulatedDrives
from tautscope.cli import main
from tautscope.config import DrivesConfig, dump_config, from_document
from tautscope.dof import Dof
from tautscope.hardware.cia402 import State
from tautscope.hardware.doctor.check_result import CheckResult
from tautscope.hardware.doctor.computer import check_disk
from tautscope.hardware.doctor.drives import check_commands, check_drives
from video_sources import write_dv
from waiting import TIMEOUT, until

Bench = Callable[..., SimulatedDrives]
CAMERA = {
    "width": 64,
    "height": 48,
    "source": {
        "url": "testsrc2=size=64x48:rate=50,realtime",
        "format": "lavfi",
        "start_timeout": TIMEOUT,
        "timeout": TIMEOUT,
    },
}


def document(hub: Path, camera: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    drives = drives_document(channel=str(hub), heartbeat_timeout=1.0, **changes)
    control = {"period": drives["cycle"]}
    camera = camera or CAMERA
    return {"camera": camera, "control": control, "drives": drives, "experiment": EXPERIMENT}


def drives_of(found: dict[str, Any]) -> DrivesConfig:
    config = from_document(found).drives
    assert config is not None
    return config


def doctor(
    capsys: pytest.CaptureFixture[str], folder: Path, found: dict[str, Any] | None
) -> tuple[int, dict[str, dict[str, Any]]]:
    arguments = ["doctor", "--json"]
    if found is not None:
        file = folder / "rig.toml"
        file.write_text(dump_config(from_document(found)), encoding="utf-8")
        arguments += ["--config", str(file)]
    status = main(arguments)
    output = json.loads(capsys.readouterr().out)
    assert output["complete"] == (status == 0)
    return status, {one["what"]: one for one in output["findings"]}


def was_never_enabled(drives: SimulatedDrives) -> bool:
    known = {state.value for state in State}
    seen = {event.what for event in drives.events}
    assert seen <= known | {f"fault: {kind}" for kind in ("fault", "refuse", "drop")}
    return State.OPERATION_ENABLED.value not in seen


def set_state(drives: SimulatedDrives, dof: Dof, state: State) -> None:
    """Set the state of a drive that has booted."""
    until(lambda: State.NOT_READY not in drives.states.values())
    drives._drives[dof]._enter(state, time.monotonic())


@pytest.fixture
def permitted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Record the requested scheduling policies; the process of the tests keeps its own."""
    asked: list[int] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda pid, policy, of: asked.append(policy))
    return asked


def set_free_space(monkeypatch: pytest.MonkeyPatch, free: float) -> None:
    """Let every disk have `free` bytes left: the disk of the computer that tests may be full."""
    usage = type("Usage", (), {"free": int(free)})
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage)


@pytest.mark.parametrize("modes", [(7, 8), (1, 7)], ids=["csp", "article"])
def test_complete_rig(
    hub: Hub,
    bench: Bench,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    permitted: list[int],
    *,
    modes: tuple[int, ...],
) -> None:
    config = document(hub.path)
    drives = bench(drives_of(config), modes=modes, start=[0.01, 0.5, 0.2])
    status, found = doctor(capsys, tmp_path, config)
    assert status == 0, found
    assert permitted == [os.SCHED_FIFO, os.sched_getscheduler(0)]
    assert found["memory kept"]["status"] in ("ok", "note")
    source = found[f"source {CAMERA['source']['url']}"]["data"]
    assert (source["width"], source["height"], source["interlaced"]) == (64, 48, False)
    assert source["rate"] == pytest.approx(50, rel=0.5)
    for dof, where in zip(Dof, (0.01, 0.5, 0.2), strict=True):
        name = f"{dof.label}, node {dof + 1}"
        assert found[name]["data"]["modes"] == list(modes)
        assert found[name]["data"]["position"] == pytest.approx(where, abs=1e-3)
        settings = found[f"{name}: settings"]["data"]
        assert settings["mode"] == modes[-1]
        assert settings["settings"]["0x607F:0 (Max profile velocity)"] == round(
            AXES[dof.label]["speed_limit"] * AXES[dof.label]["counts_per_unit"]
        )
    assert found["heartbeats and answers"]["data"]["cycles"] > 10
    assert was_never_enabled(drives)


def test_too_little_travel_for_the_experiment_is_missing(tmp_path: Path) -> None:
    config = document(tmp_path)
    assert check_commands(from_document(config)).status == "ok"
    found = check_commands(from_document(config | {"experiment": {}}))
    assert (found.status, found.found) == ("missing", "drives.rotation.travel: (-3.0, 3.5)")


def test_motor_in_quick_stop_stays_held(hub: Hub, bench: Bench) -> None:
    config = drives_of(document(hub.path))
    drives = bench(config)
    for dof in Dof:
        set_state(drives, dof, State.QUICK_STOP_ACTIVE)
    findings = check_drives(config)
    assert {one.status for one in findings} <= {"ok", "note"}, findings
    assert set(drives.states.values()) == {State.QUICK_STOP_ACTIVE}
    assert was_never_enabled(drives)


def test_interlaced_dv_is_reported_as_fields(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_dv(tmp_path / "clip.avi", 40)
    movie = {**CAMERA["source"], "url": f"movie={tmp_path / 'clip.avi'},realtime"}
    camera = {"width": 720, "height": 576, "source": movie}
    status, found = doctor(capsys, tmp_path, {"camera": camera})
    source = found[f"source {movie['url']}"]
    assert source["data"]["interlaced"] is True
    assert source["data"]["rate"] == pytest.approx(50, rel=0.5)
    assert status == 1
    assert "article_rig" in found["configuration"]["todo"]


def test_missing_camera_and_bus(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = document(tmp_path / "nobody")
    config["camera"] = {**CAMERA, "source": {"url": "/dev/video99"}}
    config["control"]["period"] = 0.005
    status, found = doctor(capsys, tmp_path, config)
    assert status == 1
    assert "ls /dev/video*" in found["source /dev/video99"]["todo"]
    assert found["pace"]["status"] == "missing"
    bus = found[f"bus tautscope {tmp_path / 'nobody'}"]
    assert bus["status"] == "missing"
    assert "drives.channel" in bus["todo"]


def test_without_a_configuration_nothing_is_opened(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, found = doctor(capsys, tmp_path, None)
    assert {"system", "disk", "V4L2 devices", "CAN interfaces"} <= found.keys()
    assert not any(what.startswith(("source", "bus")) for what in found)


def test_text_output_contains_the_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(pid: int, policy: int, of: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr("tautscope.hardware.doctor.computer._speed", lambda folder, size: 1e9)
    set_free_space(monkeypatch, 1e12)
    file = tmp_path / "rig.toml"
    file.write_text("[camera.source]\nurl = '/dev/video99'\n")
    assert main(["doctor", "--config", str(file)]) == 1
    output = capsys.readouterr().out
    assert "MISSING real-time priority: SCHED_FIFO is not permitted" in output
    assert "rtprio 60" in output
    assert "memlock unlimited" in output
    assert output.endswith("3 missing. No motor was enabled.\n")
    assert main(["doctor", "--config", str(tmp_path / "none.toml")]) == 2


def missing(findings: list[CheckResult]) -> dict[str, CheckResult]:
    return {one.what: one for one in findings if one.status == "missing"}


@pytest.mark.parametrize(
    ("options", "changes", "where", "message"),
    [
        ({"modes": (1, 3)}, {}, "rotation, node 2", "stream of positions"),
        ({"absent": (0x6007,)}, {}, "rotation, node 2: settings", "add 6007 to drives.waive"),
        ({"start": [0, 3.4, 0]}, {"home": 2.0}, "rotation, node 2", "drives.rotation.travel"),
        ({}, {"node": 9}, "rotation, node 9", "drives.rotation.node"),
    ],
    ids=["modes", "protection", "travel", "node"],
)
def test_wrong_drive_is_named_and_the_others_are_checked(
    hub: Hub,
    bench: Bench,
    *,
    options: dict[str, Any],
    changes: dict[str, Any],
    where: str,
    message: str,
) -> None:
    drives = bench(drives_of(document(hub.path)), **options)
    wrong = {"rotation": {**AXES["rotation"], **changes}, "request_timeout": 1.0}
    found = check_drives(drives_of(document(hub.path, **wrong)))
    assert message in missing(found)[where].todo, missing(found)
    assert any(one.what == "bending, node 3" for one in found)
    assert was_never_enabled(drives)


@pytest.mark.parametrize(
    ("state", "todo"),
    [
        (State.FAULT, "look error code 0x7305 (additional modules, such as sensor or brake) up"),
        (State.OPERATION_ENABLED, "end the program"),
    ],
)
def test_nothing_is_written_to_an_enabled_or_faulty_drive(
    hub: Hub, bench: Bench, state: State, todo: str
) -> None:
    config = drives_of(document(hub.path))
    drives = bench(config)
    set_state(drives, Dof.ROTATION, state)
    drives._drives[Dof.ROTATION].values[0x603F, 0] = 0x7305
    before = [dict(drive.values) for drive in drives._drives]
    found = missing(check_drives(config))
    assert found.keys() == {"rotation, node 2"}
    assert todo in found["rotation, node 2"].todo
    assert [drive.values for drive in drives._drives] == before


def test_missing_heartbeat_is_reported(hub: Hub, bench: Bench) -> None:
    config = drives_of(document(hub.path))
    drives = bench(config)
    drives.inject("heartbeat", Dof.BENDING)
    found = missing(check_drives(config))
    assert found.keys() == {"heartbeats and answers"}
    assert "bending, node 3: no heartbeat" in found["heartbeats and answers"].found


def test_full_or_slow_disk_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = from_document({})
    where = "tautscope.hardware.doctor.computer"
    set_free_space(monkeypatch, 1e12)
    monkeypatch.setattr(f"{where}._speed", lambda folder, size: 1e9)
    assert check_disk(config, tmp_path).status == "ok"
    # 720 x 576 x 3 bytes, 50 a second, 55 % of it: 34 MB/s, or 20 GB in ten minutes.
    monkeypatch.setattr(f"{where}._speed", lambda folder, size: 30e6)
    slow = check_disk(config, tmp_path)
    assert (slow.status, "faster disk" in slow.todo) == ("missing", True)
    assert slow.data["needed_per_second"] == pytest.approx(34.2e6, rel=0.01)
    set_free_space(monkeypatch, 20e9)
    assert "more space" in check_disk(config, tmp_path).todo
    monkeypatch.undo()
    assert "ls -ld" in check_disk(config, tmp_path / "none").todo
