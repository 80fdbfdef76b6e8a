"""Drives that differ from CiA 402 but work: accepted, or refused with the waiver as remedy."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from drive_settings import AXES, drives_config
from tautscope.bench import drives as simulated
from tautscope.bench.can_bus import Hub
from tautscope.bench.canopen_node import OUT_OF_RANGE, WRONG_STATE
from tautscope.bench.drive import SimulatedDrive
from tautscope.bench.drives import SimulatedDrives
from tautscope.dof import Dof
from tautscope.errors import DriveError, ModeRefusedError, StateError
from tautscope.hardware.cia402 import State
from tautscope.hardware.doctor.drives import check_drives
from tautscope.hardware.drives import open_drives

Bench = Callable[..., SimulatedDrives]
QUICK = {"heartbeat_period": 0.04, "heartbeat_timeout": 1.0, "state_timeout": 0.5}


class Mode0UntilEnabled(SimulatedDrive):
    """As in ros_canopen, issue 328: when a mode can be entered is up to the maker."""

    wanted = 0

    def on_write(self, key: tuple[int, int], value: int, now: float) -> int | None:
        code = super().on_write(key, value, now)
        if key == (0x6060, 0):
            self.wanted = value
            self.values[0x6061, 0] = 0
        return code

    def _enter(self, target: State, now: float) -> None:
        super()._enter(target, now)
        self.values[0x6061, 0] = self.wanted if target is State.OPERATION_ENABLED else 0
        self._update_statusword()


def supports(modes: int) -> type[SimulatedDrive]:
    """A drive that has modes 7 and 8, but says something else in 0x6502."""

    class Drive(SimulatedDrive):
        def boot(self, now: float) -> None:
            super().boot(now)
            if (0x6502, 0) in self.entries:
                self.values[0x6502, 0] = modes

    return Drive


def refuses(key: tuple[int, int], code: int, value: int | None = None) -> type[SimulatedDrive]:
    """A drive that refuses a value, or every one, of an object that it has."""

    class Drive(SimulatedDrive):
        def on_write(self, where: tuple[int, int], asked: int, now: float) -> int | None:
            if where == key and value in (None, asked):
                return code
            return super().on_write(where, asked, now)

    return Drive


def shows(set_bits: int, cleared: int = 0) -> type[SimulatedDrive]:
    """A drive with other bits in its statusword, in every state."""

    class Drive(SimulatedDrive):
        def _update_statusword(self) -> None:
            super()._update_statusword()
            self.values[0x6041, 0] = (self.values[0x6041, 0] | set_bits) & ~cleared

    return Drive


class ModeNeverShown(shows(1 << 12)):  # type: ignore[misc]
    def on_write(self, key: tuple[int, int], value: int, now: float) -> int | None:
        return None if key == (0x6060, 0) else super().on_write(key, value, now)


class SetOnce(SimulatedDrive):
    """It refuses to be set to the mode that it is in."""

    def boot(self, now: float) -> None:
        super().boot(now)
        self.values[0x6060, 0] = self.values[0x6061, 0] = 8

    def on_write(self, key: tuple[int, int], value: int, now: float) -> int | None:
        return WRONG_STATE if key == (0x6060, 0) else super().on_write(key, value, now)


def use(monkeypatch: pytest.MonkeyPatch, drive: type[SimulatedDrive]) -> None:
    monkeypatch.setattr(simulated, "SimulatedDrive", drive)


def move(config: Any, cycles: int = 10) -> None:
    """Enable the motors and move the first by 5 mm/s."""
    with open_drives(config) as drives:
        start, step = drives.start(), np.array([5e-3 * drives.cycle, 0, 0])
        for cycle in range(1, cycles + 1):
            applied = drives.exchange(start + step * cycle)
            time.sleep(drives.cycle / 2)
        assert 0 < applied[0] - start[0] <= cycles * step[0] + 1e-6


PLAIN = SimulatedDrive
COARSE = {"rotation": AXES["rotation"] | {"counts_per_unit": 2**24 * 100 / 6.28}}
WAIVED: dict[str, tuple[type[SimulatedDrive], dict[str, Any], dict[str, Any], str]] = {
    "mode 0 until enabled": (Mode0UntilEnabled, {}, {}, "6061"),
    "bit 12 always 0": (shows(0, 1 << 12), {}, {}, "6041.12"),
    "bit 12 always 0, mode 7": (shows(0, 1 << 12), {"modes": (7,)}, {}, "6041.12"),
    "bit 13 always 1": (shows(1 << 13), {}, {}, "6041.13"),
    "no 0x6502 (ros2_canopen 299)": (PLAIN, {"absent": (0x6502,)}, {}, "6502"),
    "no 0x6502, mode 7": (PLAIN, {"absent": (0x6502,), "modes": (7,)}, {}, "6502"),
    "0x6502 is 0 (ros_canopen 462)": (supports(0), {}, {}, "6502"),
    "0x6502 lacks the modes (ros_canopen 257)": (supports(0x15), {}, {}, "6502"),
    "no 0x1016 (ros_canopen 367)": (PLAIN, {"absent": (0x1016,)}, {}, "1016"),
    "no 0x1017 (ros_canopen 105)": (PLAIN, {"absent": (0x1017,)}, {}, "1017"),
    "no 0x607D": (PLAIN, {"absent": (0x607D,)}, {}, "607D"),
    "no 0x60C2, mode 7": (PLAIN, {"absent": (0x60C2,), "modes": (7,)}, {}, "60C2"),
    "quick stop cannot hold": (refuses((0x605A, 0), OUT_OF_RANGE, 6), {}, {}, "605A"),
    "no quick stop when the connection is lost": (
        refuses((0x6007, 0), OUT_OF_RANGE, 3),
        {},
        {},
        "6007",
    ),
    "speed out of range": (refuses((0x607F, 0), OUT_OF_RANGE), {}, {}, "607F"),
    "speed beyond 32 bits": (PLAIN, {}, COARSE, "607F"),
}
FOUND_WHEN_ENABLED = ("6041.12", "6041.13")
"""Waivers that doctor cannot find, as it enables no motor."""


@pytest.mark.parametrize("case", WAIVED)
def test_the_remedy_is_the_waiver_that_makes_it_work(
    hub: Hub, bench: Bench, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    drive, rig, settings, waiver = WAIVED[case]
    use(monkeypatch, drive)
    settings = {"channel": str(hub.path), **QUICK, **settings}
    bench(drives_config(**settings), **rig)
    with pytest.raises(DriveError) as refused:
        move(drives_config(**settings))
    assert f", add {waiver} to drives.waive" in refused.value.remedy
    if waiver not in FOUND_WHEN_ENABLED:
        found = check_drives(drives_config(**settings))
        assert any(f"add {waiver} to drives.waive" in one.todo for one in found), found
    move(drives_config(**settings, waive=[waiver]))


ACCEPTED: dict[str, tuple[type[SimulatedDrive], dict[str, Any]]] = {
    "mode set only once": (SetOnce, {"modes": (8,)}),
    "remote and voltage always 0": (shows(0, 1 << 9 | 1 << 4), {}),
    "all other bits always 1 (linuxcnc-ethercat 180, 327)": (shows(0xDD80), {}),
    "no speed limits": (PLAIN, {"absent": (0x607F, 0x6080, 0x608F)}),
    "no following error window": (PLAIN, {"absent": (0x6065, 0x6066)}),
    "no identity": (PLAIN, {"absent": (0x1018,)}),
}


@pytest.mark.parametrize("case", ACCEPTED)
def test_differences_that_do_not_matter(
    hub: Hub, bench: Bench, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    drive, rig = ACCEPTED[case]
    use(monkeypatch, drive)
    config = drives_config(channel=str(hub.path), **QUICK)
    bench(config, **rig)
    move(config)


def test_waived_mode_is_checked_as_soon_as_the_drive_is_enabled(
    hub: Hub, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, ModeNeverShown)
    config = drives_config(channel=str(hub.path), **QUICK, waive=["6061"])
    rig = bench(config)
    with pytest.raises(ModeRefusedError, match=r"did not enter mode 8.*0x6061\) is 0"):
        move(config)
    assert set(rig.states.values()) == {State.QUICK_STOP_ACTIVE}


def test_drive_under_another_command_is_named(
    hub: Hub, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Local(shows(0, 1 << 9)):  # type: ignore[misc]
        def _control(self, word: int, now: float) -> None:
            pass

    use(monkeypatch, Local)
    config = drives_config(channel=str(hub.path), **QUICK)
    bench(config)
    with pytest.raises(
        StateError, match=r"stays in switch on disabled.*not commanded from the bus"
    ):
        move(config)


class Restless(SimulatedDrive):
    """A drive without mains whose statusword changes all the time, until it has done so often."""

    changes = 0
    most = 1000

    def _is_restless(self) -> bool:
        self.changes += 1
        return self.changes < self.most


class Toggling(Restless):
    """It takes no command, and its toggle bit changes in every statusword."""

    def _control(self, word: int, now: float) -> None:
        pass

    def _update_statusword(self) -> None:
        super()._update_statusword()
        self.values[0x6041, 0] |= (self._is_restless() and self.changes & 1) << 10


class FallingBack(Restless):
    """It falls back each time that it is switched on."""

    def _enter(self, target: State, now: float) -> None:
        falls = target in (State.SWITCHED_ON, State.OPERATION_ENABLED) and self._is_restless()
        super()._enter(State.SWITCH_ON_DISABLED if falls else target, now)


@pytest.mark.parametrize(("kind", "most"), [(Toggling, 1000), (FallingBack, 200)])
def test_start_ends_though_a_drive_is_never_still(
    hub: Hub, bench: Bench, monkeypatch: pytest.MonkeyPatch, kind: type[Restless], most: int
) -> None:
    use(monkeypatch, kind)
    monkeypatch.setattr(kind, "most", most)
    config = drives_config(channel=str(hub.path), **QUICK)
    rig = bench(config)
    with pytest.raises(StateError, match="it stays in"):
        move(config)
    assert all(drive.changes < most for drive in rig._drives)  # type: ignore[attr-defined]


def test_protections_of_the_other_drives_stay(hub: Hub, bench: Bench) -> None:
    """Waivers hold for all drives, but what a drive has is set nevertheless."""
    config = drives_config(channel=str(hub.path), **QUICK, waive=["1016", "6007", "605A"])
    rig = bench(config)
    for key in ((0x1016, 1), (0x6007, 0)):
        del rig._drives[Dof.INSERTION].entries[key]
    with open_drives(config) as drives:
        assert drives.commissioned[Dof.INSERTION].absent == (
            "0x6007:0 (Abort connection option code)",
        )
        values = rig._drives[Dof.BENDING].values
        assert (values[0x6007, 0], values[0x605A, 0]) == (3, 6)
        assert values[0x1016, 1] == 127 << 16 | 1000
        drives.start()
    assert values[0x1016, 1] == 0  # so that the drives do not miss the closed master


def test_silent_drive_without_heartbeat_is_noticed_by_its_answers(hub: Hub, bench: Bench) -> None:
    times = QUICK | {"heartbeat_timeout": 0.3}
    config = drives_config(channel=str(hub.path), **times, waive=["1017"])
    rig = bench(config, absent=(0x1017,))
    with open_drives(config) as drives:
        command = drives.start()
        for _ in range(round(2 * config.heartbeat_timeout / config.cycle)):
            drives.exchange(np.asarray(command))
            time.sleep(drives.cycle)
        rig.inject("drop", Dof.ROTATION)
        with pytest.raises(DriveError, match=r"rotation, node 2: no answer to \d+ set-points"):
            for _ in range(1000):
                drives.exchange(np.asarray(command))
                time.sleep(drives.cycle / 2)
