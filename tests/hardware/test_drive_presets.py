"""Presets of makers' drives, with simulated drives that differ as their sources say."""

import time
from collections.abc import Callable
from typing import Any, get_args

import numpy as np
import pytest
from drive_settings import drives_config, drives_document
from tautscope.bench import drives as simulated
from tautscope.bench.can_bus import Hub
from tautscope.bench.canopen_node import OUT_OF_RANGE, READ_ONLY
from tautscope.bench.drive import SimulatedDrive
from tautscope.bench.drives import SimulatedDrives
from tautscope.config import DrivesConfig, dump_config, from_document
from tautscope.config.drive_defaults import FOLDER
from tautscope.config.drives import Preset
from tautscope.dof import Dof
from tautscope.errors import ConfigError, FollowingError, SettingRefusedError
from tautscope.hardware.doctor.drives import check_drives
from tautscope.hardware.drives import open_drives

Bench = Callable[..., SimulatedDrives]
QUICK = {"heartbeat_period": 0.04, "heartbeat_timeout": 0.8}
PARAMETER_INCOMPATIBLE = 0x0604_0043


class Interpolating(SimulatedDrive):
    """It must know the time between set-points in mode 8, and expects 1 ms."""

    def _apply_setpoint(self) -> None:
        time_between = self.values[0x60C2, 1] * 10.0 ** self.values[0x60C2, 2]
        if time_between == pytest.approx(self.cycle):  # else it goes nowhere
            super()._apply_setpoint()


class Copley(Interpolating):
    """Its speeds are in 0.1 counts/s."""

    def _apply_setpoint(self) -> None:
        limit = self.values[0x607F, 0]
        self.values[0x607F, 0] = limit // 10
        super()._apply_setpoint()
        self.values[0x607F, 0] = limit


class Epos4(Interpolating):
    """Its speeds are in rev/min; it refuses what no motor can do."""

    def on_write(self, key: tuple[int, int], value: int, now: float) -> int | None:
        if key in ((0x607F, 0), (0x6080, 0)) and value > 50_000:
            return OUT_OF_RANGE
        return super().on_write(key, value, now)


class Whistle(SimulatedDrive):
    """A second heartbeat consumer entry of a node, and another unit of time are refused."""

    def on_write(self, key: tuple[int, int], value: int, now: float) -> int | None:
        if key == (0x60C2, 2):
            return READ_ONLY
        if key == (0x1016, 1) and value and self.values[0x1016, 1]:
            return PARAMETER_INCOMPATIBLE
        return super().on_write(key, value, now)


RIGS: dict[str, tuple[type[SimulatedDrive], tuple[int, ...]]] = {
    "copley": (Copley, (1, 3, 6, 7, 8)),
    "elmo_gold": (Interpolating, (1, 3, 4, 6, 7, 8, 9, 10)),
    "elmo_whistle": (Whistle, (1, 3, 4, 6, 7)),
    "epos4": (Epos4, (1, 3, 6, 8, 9, 10)),
}


@pytest.fixture
def rig(hub: Hub, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> Callable[..., SimulatedDrives]:
    def make(name: str) -> SimulatedDrives:
        drive, modes = RIGS[name]
        monkeypatch.setattr(simulated, "SimulatedDrive", drive)
        return bench(drives_config(channel=str(hub.path), **QUICK), modes=modes)

    return make


def run(config: DrivesConfig) -> None:
    """Move insertion at 0.05 m/s for half a second."""
    with open_drives(config) as drives:
        start, step = drives.start(), np.array([0.05 * drives.cycle, 0, 0])
        for cycle in range(1, 26):
            applied = drives.exchange(start + step * cycle)
            time.sleep(drives.cycle / 2)
        assert applied[Dof.INSERTION] - start[Dof.INSERTION] > 15 * step[Dof.INSERTION]


def test_every_preset_is_tested() -> None:
    assert sorted(RIGS) == sorted(get_args(Preset))
    assert sorted(RIGS) == sorted(file.stem for file in FOLDER.iterdir())


@pytest.mark.parametrize("name", RIGS)
def test_from_doctor_to_a_run(hub: Hub, rig: Callable[..., SimulatedDrives], name: str) -> None:
    rig(name)
    config = drives_config(channel=str(hub.path), preset=name, **QUICK)
    findings = check_drives(config)
    assert {one.status for one in findings} <= {"ok", "note"}, findings
    run(config)


@pytest.mark.parametrize(
    ("name", "keys", "error"),
    [
        ("copley", {"interpolation_time": True}, FollowingError),
        ("epos4", {"interpolation_time": True}, SettingRefusedError),
        ("epos4", {"waive": ["607F"]}, FollowingError),
        ("elmo_gold", {}, FollowingError),
    ],
)
def test_every_key_of_a_preset_is_needed(
    hub: Hub,
    rig: Callable[..., SimulatedDrives],
    name: str,
    keys: dict[str, Any],
    error: type[Exception],
) -> None:
    rig(name)
    with pytest.raises(error, match=r"insertion, node 1: (following error|it refused 0x607F)"):
        run(drives_config(channel=str(hub.path), **keys, **QUICK))


@pytest.mark.parametrize("name", RIGS)
def test_keys_replace_those_of_the_preset_and_waivers_add_up(name: str) -> None:
    changes: dict[str, Any] = {"preset": name, "waive": ["6007", "607F"]}
    config = from_document({"drives": drives_document(**changes, interpolation_time=False)})
    assert config.drives is not None
    assert not config.drives.interpolation_time
    assert sorted(config.drives.waive) == ["6007", "607F"]
    assert config.replace(**{"twin.seed": 3}).drives == config.drives
    assert f'preset = "{name}"' in dump_config(config)


@pytest.mark.parametrize(
    ("changes", "field", "allowed"),
    [
        ({"preset": "epos2"}, "drives.preset", "elmo_gold"),
        ({"preset": "epos4", "waive": "6007"}, "drives.waive", "list"),
        ({"preset": "epos4", "waive": ["6000"]}, "drives.waive", "6502"),
    ],
)
def test_wrong_preset_or_waiver(changes: dict[str, Any], field: str, allowed: str) -> None:
    with pytest.raises(ConfigError) as found:
        drives_config(**changes)
    assert found.value.field.startswith(field)
    assert allowed in found.value.allowed
