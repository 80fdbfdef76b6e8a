"""Missing and unsuitable drives are refused before a motor is enabled."""

from collections.abc import Callable

import numpy as np
import pytest
from drive_settings import AXES, drives_config
from tautscope.bench.can_bus import Hub
from tautscope.bench.canopen_node import CanopenNode
from tautscope.bench.drives import SimulatedDrives
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    FollowingError,
    ModeRefusedError,
    SettingRefusedError,
    SilentDriveError,
)
from tautscope.hardware.cia402 import State
from tautscope.hardware.drives import open_drives
from waiting import until

Bench = Callable[..., SimulatedDrives]


def hex_of(key: tuple[int, int]) -> str:
    return f"{key[0]:04X}:{key[1]}"


def test_mode_refused_by_the_drive(hub: Hub, bench: Bench) -> None:
    config = drives_config(channel=str(hub.path), state_timeout=0.2)
    rig = bench(config, modes=(7,))
    rig.inject("refuse", Dof.BENDING)
    until(lambda: any(event.what == "fault: refuse" for event in rig.events))
    with pytest.raises(ModeRefusedError, match=r"bending, node 3: it did not enter mode 7.*is 0"):
        open_drives(config)


def test_drive_without_position_streaming_mode(hub: Hub, bench: Bench) -> None:
    config = drives_config(channel=str(hub.path))
    bench(config, modes=(1, 3, 6))
    with pytest.raises(ModeRefusedError, match="0x00000025: neither"):
        open_drives(config)


def test_missing_drive(hub: Hub, bench: Bench) -> None:
    bench(drives_config())
    rotation = AXES["rotation"] | {"node": 9}
    other = drives_config(channel=str(hub.path), request_timeout=0.3, rotation=rotation)
    with pytest.raises(SilentDriveError, match=r"rotation, node 9.*Check drives.rotation.node"):
        open_drives(other)


def test_missing_protection_must_be_waived(hub: Hub, bench: Bench) -> None:
    config = drives_config(channel=str(hub.path))
    bench(config, absent=(0x6007, 0x6080))
    with pytest.raises(SettingRefusedError, match=r"add 6007 to drives\.waive"):
        open_drives(config)
    with open_drives(drives_config(channel=str(hub.path), waive=["6007"])) as drives:
        for one in drives.commissioned:
            assert [name[:6] for name in one.absent] == ["0x6007", "0x6080"]


@pytest.mark.parametrize("index", [0x6502, 0x6064, 0x1401, 0x1016])
def test_missing_mandatory_object(hub: Hub, bench: Bench, index: int) -> None:
    config = drives_config(channel=str(hub.path))
    bench(config, absent=(index,))
    with pytest.raises(SettingRefusedError, match=r"insertion, node 1"):
        open_drives(config)


@pytest.mark.parametrize("key", [(0x605A, 0), (0x607D, 2), (0x1017, 0), (0x1401, 2)], ids=hex_of)
def test_setting_that_reads_back_differently(
    hub: Hub, bench: Bench, monkeypatch: pytest.MonkeyPatch, key: tuple[int, int]
) -> None:
    store = CanopenNode._store

    def other(self: CanopenNode, where: tuple[int, int], value: int, now: float) -> int | None:
        return store(self, where, value - (where == key), now)

    monkeypatch.setattr(CanopenNode, "_store", other)
    config = drives_config(channel=str(hub.path))
    bench(config)
    with pytest.raises(SettingRefusedError, match=rf"0x{key[0]:04X}:{key[1]}.*reads back"):
        open_drives(config)


def test_protections_and_limits_are_written_to_the_drive(hub: Hub, bench: Bench) -> None:
    """In counts, with the rotation's sign -1 and home 0.25 rad calculated by hand."""
    config = drives_config(channel=str(hub.path))
    rig = bench(config)
    with open_drives(config):
        values = rig._drives[Dof.ROTATION].values
        assert values[0x6007, 0] == 3
        assert values[0x605A, 0] == 6
        assert values[0x607D, 1] == -32_500  # -(3.5 - 0.25) 10000
        assert values[0x607D, 2] == 32_500  # -(-3.0 - 0.25) 10000
        assert values[0x607F, 0] == 200_000  # 20 rad/s
        assert values[0x6080, 0] == 2930  # 200000 60 / 4096 = 2929.7 per minute
        assert values[0x1017, 0] == 100
        assert values[0x1016, 1] == 127 << 16 | 3000


def test_motor_outside_its_travel_is_not_enabled(hub: Hub, bench: Bench) -> None:
    config = drives_config(channel=str(hub.path))
    rig = bench(config, start=np.array([0.0, 0.0, 2.5]))
    with (
        open_drives(config) as drives,
        pytest.raises(FollowingError, match=r"bending.*outside its travel.*home, sign"),
    ):
        drives.start()
    assert not any(event.what == State.OPERATION_ENABLED for event in rig.events)


def test_missing_bus() -> None:
    with pytest.raises(BusError, match=r"no rig answers on /nowhere\. Start `tautscope bench`"):
        open_drives(drives_config(channel="/nowhere"))
    with pytest.raises(BusError, match="sudo ip link set can7 up type can bitrate 1000000"):
        open_drives(drives_config(interface="socketcan", channel="can7"))
    with pytest.raises(BusError, match="cannot be opened"):
        open_drives(drives_config(interface="no_such_interface"))


def test_drive_following_error_window_includes_the_lag(hub: Hub, bench: Bench) -> None:
    """The drive compares with its present set-point, so the travel during the lag is added."""
    config = drives_config(channel=str(hub.path), lag=0.03, following_timeout=0.07)
    bench(config)
    with open_drives(config) as drives:
        windows = [one.settings["0x6065:0 (Following error window)"] for one in drives.commissioned]
        times = [one.settings["0x6066:0 (Following error time out)"] for one in drives.commissioned]
    assert windows == [4000 + 4500, 3000 + 6000, 2000 + 3000]
    assert times == [70, 70, 70]
