"""One master per bus: hazard M1."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from servo_settings import servos_config
from tautscope.config import DrivesConfig, load_config
from tautscope.errors import SecondMasterError
from tautscope.hardware import drives as drives_module
from tautscope.hardware.drives import open_drives
from tautscope.hardware.rig_lock import RigLock, lock_path

if sys.platform == "win32":
    pytest.skip("Windows has no such lock", allow_module_level=True)

HOLD = """
import sys
from tautscope.config import load_config
from tautscope.hardware.rig_lock import RigLock
with RigLock(load_config("bench").drives):
    print("locked", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> DrivesConfig:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    found = load_config("bench").drives
    assert found is not None
    return found


def test_a_second_master_is_refused_until_the_first_has_ended(bus: DrivesConfig) -> None:
    with RigLock(bus):
        for _ in range(3):
            with pytest.raises(SecondMasterError, match="another program commands these drives"):
                RigLock(bus)
    with RigLock(bus):
        pass


def test_other_users_can_lock_it_later_whatever_the_umask(bus: DrivesConfig) -> None:
    mask = os.umask(0o077)
    try:
        with RigLock(bus):
            assert lock_path(bus).stat().st_mode & 0o777 == 0o644
    finally:
        os.umask(mask)


def test_two_names_of_a_port_are_one_bus(tmp_path: Path) -> None:
    (tmp_path / "by-id").symlink_to(tmp_path / "port")
    both = [
        servos_config("feetech", tmp_path, channel=str(tmp_path / x)) for x in ("port", "by-id")
    ]
    assert lock_path(both[0]) == lock_path(both[1])


def test_another_bus_is_free(bus: DrivesConfig) -> None:
    other = load_config("bench").replace(**{"drives.channel": "/tmp/other"}).drives
    assert other is not None
    assert lock_path(other) != lock_path(bus)
    with RigLock(bus), RigLock(other):
        pass


def test_another_process_holds_the_lock_until_it_is_killed(bus: DrivesConfig) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"locked\n"
        with pytest.raises(SecondMasterError):
            RigLock(bus)
        os.kill(process.pid, signal.SIGKILL)
    with RigLock(bus):
        pass


def test_drives_are_not_opened_twice(bus: DrivesConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[DrivesConfig] = []
    monkeypatch.setattr(drives_module, "open_group", opened.append)
    with RigLock(bus), pytest.raises(SecondMasterError):
        open_drives(bus)
    assert opened == []


def test_a_lock_is_released_when_the_bus_cannot_be_opened(
    bus: DrivesConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(config: DrivesConfig) -> None:
        raise RuntimeError(config.channel)

    monkeypatch.setattr(drives_module, "open_group", fail)
    with pytest.raises(RuntimeError):
        open_drives(bus)
    with RigLock(bus):
        pass
