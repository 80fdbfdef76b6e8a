"""Every fault ends in a quick stop of all motors and an error with a remedy."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
import paced_motion
import pytest
from drive_settings import drives_config
from tautscope.bench import drives as simulated
from tautscope.bench.can_bus import Hub, LocalBus
from tautscope.bench.drive import SimulatedDrive
from tautscope.bench.drives import SimulatedDrives
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    ConfigError,
    DriveError,
    EmergencyError,
    FollowingError,
    HeartbeatError,
    SecondMasterError,
    SignalError,
    SilentDriveError,
    StateError,
)
from tautscope.hardware.cia402 import STOPPED_STATES, State
from tautscope.hardware.drives import Drives, open_drives
from waiting import until

drive = partial(paced_motion.drive, speed=np.array([0.01, 1.5, 0.8]))
Bench = Callable[..., SimulatedDrives]


@contextmanager
def running(
    hub: Hub, bench: Bench, *plant: Any, **changes: Any
) -> Iterator[tuple[SimulatedDrives, Drives]]:
    """Simulated drives and their master, enabled."""
    config = drives_config(channel=str(hub.path), **changes)
    rig = bench(config, *plant)
    with open_drives(config) as drives:
        drives.start()
        yield rig, drives


def at_rest(rig: SimulatedDrives) -> bool:
    return all(state in STOPPED_STATES for state in rig.states.values())


@pytest.mark.parametrize(
    ("kind", "errors", "message"),
    [
        ("fault", EmergencyError, "emergency 0x4310"),
        ("freeze", FollowingError, "blocks the motor"),
        ("heartbeat", HeartbeatError, "no heartbeat for"),
        ("drop", (HeartbeatError, SilentDriveError), "Check its supply"),
        ("delay", (HeartbeatError, SilentDriveError), "Check its supply"),
        ("refuse", StateError, "changed from mode 8 to 0"),
    ],
)
def test_fault_while_running_stops_all_motors(
    hub: Hub, bench: Bench, kind: str, errors: type[DriveError], message: str
) -> None:
    with running(hub, bench) as (rig, drives):
        drive(drives, 5)
        rig.inject(kind, Dof.ROTATION, 60.0)  # type: ignore[arg-type]
        with pytest.raises(errors, match=message) as found:
            drive(drives, 10_000)
        assert "rotation, node 2" in str(found.value)
        assert not drives.is_running
        if kind in ("drop", "delay"):
            assert "quick stop is not confirmed" in str(found.value.__notes__)
            # It received the quick stop, or missed the master's heartbeat.
            rig.clear(Dof.ROTATION)
            until(lambda: at_rest(rig))
        assert at_rest(rig)
        with pytest.raises(StateError, match="before start\\(\\) or after stop"):
            drives.exchange([0, 0, 0])


def test_pause_of_the_master_is_reported(hub: Hub, bench: Bench) -> None:
    """The drives report the missing heartbeat of the master."""
    with running(hub, bench, heartbeat_timeout=0.6, heartbeat_period=0.02) as (rig, drives):
        drive(drives, 3)
        time.sleep(2 * drives.config.heartbeat_timeout)
        with pytest.raises(EmergencyError, match="emergency 0x8130") as found:
            drive(drives, 1)
        assert "This computer paused for" in str(found.value.__notes__)
        assert at_rest(rig)


def test_late_answers_are_counted(hub: Hub, bench: Bench) -> None:
    with running(hub, bench) as (rig, drives):
        rig.inject("delay", Dof.BENDING, 3 * drives.config.cycle)
        drive(drives, 10)
        assert drives.statistics.late[Dof.BENDING] >= 1
        assert drives.statistics.cycles == 10


def test_fault_persists_until_it_is_reset(hub: Hub, bench: Bench) -> None:
    config = drives_config(channel=str(hub.path))
    rig = bench(config)
    with open_drives(config) as drives:
        drives.start()
        rig.inject("fault", Dof.INSERTION)
        with pytest.raises(EmergencyError):
            drive(drives, 10_000)
    rig.clear(Dof.INSERTION)
    with open_drives(config) as drives:
        with pytest.raises(StateError, match="reset_faults"):
            drives.start()
        assert at_rest(rig)
        drives.start(reset_faults=True)
        assert set(rig.states.values()) == {State.OPERATION_ENABLED}


class Resuming(SimulatedDrive):
    """A drive that enable operation brings from quick stop active back to operation enabled."""

    def _control(self, word: int, now: float) -> None:
        if self.status is State.QUICK_STOP_ACTIVE and word & 0x0F == 0x0F:
            self._enter(State.OPERATION_ENABLED, now)
        else:
            super()._control(word, now)


def test_reset_of_a_fault_enables_no_held_drive(
    hub: Hub, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulated, "SimulatedDrive", Resuming)
    with running(hub, bench) as (rig, drives):
        drives.stop()
        rig.inject("fault", Dof.BENDING)
        until(lambda: rig.states[Dof.BENDING] is State.FAULT)
        count = len(rig.events)
        drives.start(reset_faults=True)
        states = [one.what for one in rig.events[count:] if one.dof == Dof.INSERTION.label]
        assert states[0] == "switch on disabled"


@pytest.mark.parametrize("is_running", [True, False])
def test_disable_quick_stops_before_it_disables_voltage(
    hub: Hub, bench: Bench, *, is_running: bool
) -> None:
    config = drives_config(channel=str(hub.path))
    rig = bench(config)
    with open_drives(config) as drives:
        drives.disable()  # never enabled: no effect
        drives.start()
        drive(drives, 5)
        if not is_running:
            drives.stop()
        drives.disable()
        assert set(rig.states.values()) == {State.SWITCH_ON_DISABLED}
        with pytest.raises(StateError, match="before start\\(\\) or after stop"):
            drives.exchange([0, 0, 0])
    entered = [
        (event.dof, event.what) for event in rig.events if not event.what.startswith("fault")
    ]
    for dof in Dof:
        states = [what for source, what in entered if source == dof.label]
        assert states[-3:] == ["operation enabled", "quick stop active", "switch on disabled"]


def test_unconfirmed_disabling_raises(hub: Hub, bench: Bench) -> None:
    with running(hub, bench, state_timeout=1.0) as (rig, drives):
        drives.stop()
        rig.inject("drop", Dof.ROTATION)
        with pytest.raises(StateError, match="rotation, node 2: disabling is not confirmed"):
            drives.disable()
        assert rig.states[Dof.INSERTION] is State.SWITCH_ON_DISABLED
        rig.clear(Dof.ROTATION)


def test_disabling_disables_the_others_though_one_does_not_stop(hub: Hub, bench: Bench) -> None:
    with running(hub, bench, state_timeout=1.0) as (rig, drives):
        rig.inject("drop", Dof.ROTATION)
        with pytest.raises(StateError, match="rotation, node 2: disabling is not confirmed"):
            drives.disable()
        assert rig.states[Dof.INSERTION] is rig.states[Dof.BENDING] is State.SWITCH_ON_DISABLED
        rig.clear(Dof.ROTATION)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ([np.nan, 0, 0], r"command\[insertion\].*finite"),
        ([0, 0, np.inf], r"command\[bending\].*finite"),
        ([0, 3.6, 0], r"command\[rotation\].*travel"),
        ([0, 0, 0.21], r"command\[bending\].*speed_limit"),
        ([0, 0], "command: got"),
        ("left", "command: got"),
    ],
)
def test_invalid_commands_are_refused(
    hub: Hub, bench: Bench, command: object, message: str
) -> None:
    with running(hub, bench) as (rig, drives):
        with pytest.raises(SignalError, match=message):
            drives.exchange(command)  # type: ignore[arg-type]
        assert at_rest(rig)
        assert not drives.is_running


def test_encoder_jump_stops_all_motors(hub: Hub, bench: Bench) -> None:
    """The plant reports an impossible position."""
    jump = np.zeros(3)
    with running(hub, bench, lambda demand: demand + jump) as (rig, drives):
        drive(drives, 5)
        jump[Dof.INSERTION] = 0.02
        with pytest.raises(FollowingError, match="insertion, node 1"):
            drive(drives, 10_000)
    assert at_rest(rig)


def test_second_master_is_refused(hub: Hub, bench: Bench, station: Callable[[], LocalBus]) -> None:
    with running(hub, bench) as (rig, drives):
        drive(drives, 5)
        # The second receives the first's SYNC.
        with pytest.raises(SecondMasterError):
            listen_while(drives)
        assert drives.is_running
    assert at_rest(rig)


def listen_while(drives: Drives) -> None:
    import threading

    from tautscope.hardware.canopen_fieldbus import CanopenFieldbus

    ending = threading.Event()

    def go_on() -> None:
        while not ending.is_set():
            drives.exchange(drives.last_command)
            time.sleep(drives.cycle / 2)

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        CanopenFieldbus(drives.config).close()
    finally:
        ending.set()
        thread.join()


def test_unplugged_bus(hub: Hub, bench: Bench) -> None:
    """No command reaches the drives; they miss the master's heartbeat."""
    config = drives_config(channel=str(hub.path))
    rig = bench(config)
    drives = open_drives(config)
    drives.start()
    drive(drives, 5)
    hub.close()
    with pytest.raises(BusError, match="Plug the adapter in"):
        drive(drives, 10_000)
    drives.close()
    until(lambda: set(rig.states.values()) == {State.QUICK_STOP_ACTIVE})


def test_unknown_fault_is_refused(bench: Bench) -> None:
    rig = bench(drives_config())
    with pytest.raises(ConfigError, match=r"fault: got 'explode'"):
        rig.inject("explode", Dof.BENDING)  # type: ignore[arg-type]
