"""Three simulated CiA 402 drives, with a plant behind them and faults on request.

    with Hub(path), LocalBus(path) as bus, SimulatedDrives(bus, truth, plant) as drives: ...

As a process of its own: ``python -m tautscope.bench.drives --config FILE --socket PATH`` reads
requests for faults from its standard input, a line each (``freeze rotation``, ``clear rotation``),
writes what the drives do as JSON lines, and ends with its input.
"""

from __future__ import annotations

import argparse
import heapq
import itertools
import json
import math
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, Self, get_args

import can
import numpy as np
from numpy.typing import NDArray

from tautscope.bench.can_bus import Hub, LocalBus
from tautscope.bench.canopen_node import OPERATIONAL, OUT_OF_RANGE, CanopenNode, Key, Send
from tautscope.config import DrivesConfig, load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.hardware.cia402 import Mode, Scale, State

FaultKind = Literal["drop", "delay", "fault", "freeze", "heartbeat", "refuse"]
"""drop: says and hears nothing. delay: says everything late. fault: emergency, then fault state.
freeze: its position stands still, whatever it is told. heartbeat: no more heartbeats. refuse:
takes no mode from now on."""

OnSync = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Takes where the motors are told to be (3,) [m, rad, rad] and gives where they are; called once
per SYNC, after the drives have answered it."""

_STATUSWORD = {
    State.NOT_READY: 0x0000,
    State.SWITCH_ON_DISABLED: 0x0240,
    State.READY: 0x0221,
    State.SWITCHED_ON: 0x0233,
    State.OPERATION_ENABLED: 0x0237,
    State.QUICK_STOP_ACTIVE: 0x0217,
    State.FAULT: 0x0208,
}
OVERHEATED = 0x4310
"""Emergency code: excess temperature of the drive."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something a drive did.

    Attributes:
        time: [s], the computer's monotonic clock, the same in all its processes.
        dof: Which drive.
        what: The state it went to, or ``fault: <kind>``.
    """

    time: float
    dof: str
    what: str


class SimulatedDrive(CanopenNode):
    """One drive: the state machine, modes 7 and 8, limits, quick stop.

    Args:
        dof: Which motor.
        config: The rig as it is, whatever the other side believes.
        send: As `CanopenNode`.
        log: Called with the time and what happened.
        modes: The modes it supports.
        absent: As `CanopenNode`.
    """

    def __init__(
        self,
        dof: Dof,
        config: DrivesConfig,
        send: Send,
        log: Callable[[float, str], None],
        *,
        modes: frozenset[int],
        absent: frozenset[int] = frozenset(),
    ) -> None:
        super().__init__(config[dof].node, send, absent)
        self.scale = Scale(config[dof], dof.label)
        self.cycle = config.cycle
        self.status = State.NOT_READY
        self.demand = 0
        self.refusing = False
        self._log = log
        self._modes = modes
        self._points: deque[int] = deque(maxlen=64)
        self._interpolating = False
        self._limited = False
        self._armed = True  # bit 7 was 0: the next 1 resets a fault

    def boot(self, now: float) -> None:
        """Power on: as `CanopenNode.boot`; the motor is not powered and stays where it is."""
        actual = self.values.get((0x6064, 0), 0)
        super().boot(now)
        self.values[0x6502, 0] = sum(1 << (mode - 1) for mode in self._modes)
        self.values[0x6064, 0] = actual
        self.demand = actual
        self._go(State.SWITCH_ON_DISABLED, now)

    def set_actual(self, counts: int) -> None:
        """Where the motor is."""
        self.values[0x6064, 0] = counts
        if self.status not in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE):
            self.demand = counts

    def fail(self, now: float) -> None:
        """An internal fault: emergency, fault state."""
        self.emergency(OVERHEATED, 0x09)
        self._go(State.FAULT, now)

    def on_write(self, key: Key, value: int, now: float) -> int | None:
        """Controlword and mode act at once; all else is stored."""
        if key == (0x6040, 0):
            self._control(value, now)
        elif key == (0x6060, 0):
            if value not in self._modes:
                return OUT_OF_RANGE
            if not self.refusing:
                self.values[0x6061, 0] = value
        elif key == (0x60C2, 1) and self._interpolating:
            return OUT_OF_RANGE
        return None

    def on_sync(self, now: float) -> None:
        """Say where the motor is, then take the set-point."""
        self._update_statusword()
        self.answer(0x1800)
        if self.status is State.OPERATION_ENABLED:
            self._advance()
        elif self.status is State.QUICK_STOP_ACTIVE and self.values[0x605A, 0] == 2:
            self._go(State.SWITCH_ON_DISABLED, now)

    def on_heartbeat_lost(self, now: float) -> None:
        """What 0x6007 says: 1 fault, 2 disable, 3 quick stop."""
        if self.status is not State.OPERATION_ENABLED:
            return
        reaction = self.values.get((0x6007, 0), 0)
        if reaction == 1:
            self._go(State.FAULT, now)
        elif reaction == 2:
            self._go(State.SWITCH_ON_DISABLED, now)
        elif reaction == 3:
            self._go(State.QUICK_STOP_ACTIVE, now)

    def on_stopped(self, now: float) -> None:
        """Leaving operational is a lost connection."""
        self.on_heartbeat_lost(now)

    def _control(self, word: int, now: float) -> None:
        """The command table of CiA 402 for bits 7, 3, 2, 1, 0."""
        status = self.status
        resets = bool(word & 0x80) and self._armed
        self._armed = not word & 0x80
        if status is State.FAULT:
            if resets:
                self.emergency(0, 0)
                self._go(State.SWITCH_ON_DISABLED, now)
            return
        if not word & 0x02:
            target = State.SWITCH_ON_DISABLED
        elif not word & 0x04:
            enabled = status in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
            target = State.QUICK_STOP_ACTIVE if enabled else State.SWITCH_ON_DISABLED
        elif status is State.QUICK_STOP_ACTIVE:
            return  # out of it only through disable voltage
        elif not word & 0x01:
            target = State.READY
        elif status is State.SWITCH_ON_DISABLED:
            return  # must be ready first
        else:
            target = State.OPERATION_ENABLED if word & 0x08 else State.SWITCHED_ON
        self._interpolating = target is State.OPERATION_ENABLED and bool(word & 0x10)
        self._go(target, now)

    def _go(self, target: State, now: float) -> None:
        if target is self.status:
            return
        self.status = target
        if target is State.OPERATION_ENABLED:
            self._points.clear()
            self.demand = self.values[0x6064, 0]
            self.values[0x607A, 0] = self.values[0x60C1, 1] = self.demand
        else:
            self._interpolating = False
        self._update_statusword()
        self._log(now, target.value)

    def _advance(self) -> None:
        if self.values[0x6061, 0] == Mode.CYCLIC_SYNCHRONOUS_POSITION:
            target = self.values[0x607A, 0]
        elif self.values[0x6061, 0] == Mode.INTERPOLATED_POSITION:
            self._points.append(self.values[0x60C1, 1])
            if not self._interpolating:
                return
            target = self._points.popleft()
        else:
            return
        lower, upper = (self.values.get((0x607D, sub), 0) for sub in (1, 2))
        inside = min(max(target, lower), upper) if upper > lower else target
        reach = math.ceil(self.values.get((0x607F, 0), 0xFFFF_FFFF) * self.cycle) + 1
        self._limited = inside != target
        self.demand += min(max(inside - self.demand, -reach), reach)

    def _update_statusword(self) -> None:
        word = _STATUSWORD[self.status]
        if self.status is State.OPERATION_ENABLED:
            follows = self.values[0x6061, 0] == Mode.CYCLIC_SYNCHRONOUS_POSITION
            word |= (follows or self._interpolating) << 12
            word |= self._limited << 11
        self.values[0x6041, 0] = word


class SimulatedDrives:
    """Three drives on one bus, in a thread.

    Args:
        bus: Where they are; it stays open.
        config: The rig as it is: units, signs, node ids.
        on_sync: The plant; without it, motors that are where they are told to be.
        start: (3,) where the motors are at power-on [m, rad, rad].
        modes: The modes they support; (7,) is the article's kind of drive.
        absent: Objects they do not have, by index.
    """

    def __init__(
        self,
        bus: can.BusABC,
        config: DrivesConfig,
        on_sync: OnSync | None = None,
        *,
        start: NDArray[np.float64] | None = None,
        modes: tuple[int, ...] = (7, 8),
        absent: tuple[int, ...] = (),
    ) -> None:
        self._bus = bus
        self._on_sync = on_sync
        self._events: list[Event] = []
        self._requests: deque[tuple[FaultKind | None, Dof, float]] = deque()
        self._late: list[tuple[float, int, can.Message]] = []
        self._order = itertools.count()
        self._faults: dict[Dof, dict[FaultKind, float]] = {dof: {} for dof in Dof}
        self._drives = [
            SimulatedDrive(
                dof,
                config,
                self._sender(dof),
                self._logger(dof),
                modes=frozenset(modes),
                absent=frozenset(absent),
            )
            for dof in Dof
        ]
        where = np.zeros(3) if start is None else np.asarray(start, dtype=np.float64)
        for drive, position in zip(self._drives, where, strict=True):
            drive.values[0x6064, 0] = drive.scale.to_counts(float(position))
        self._unplugged = False
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="simulated drives", daemon=True)
        self.failure: BaseException | None = None

    def start(self) -> None:
        """Power on."""
        self._thread.start()

    def stop(self) -> None:
        """Power off.

        Raises:
            BaseException: What ended the thread before, the plant's error for one.
        """
        self._ending.set()
        if self._thread.ident is not None:
            self._thread.join()
        if self.failure is not None:
            raise self.failure

    def inject(self, kind: FaultKind, dof: Dof, delay: float = 0.3) -> None:
        """Ask for a fault; `delay` [s] is that of ``delay``.

        Raises:
            ConfigError: No such fault.
        """
        if kind not in get_args(FaultKind):
            raise ConfigError("fault", kind, "one of " + ", ".join(get_args(FaultKind)))
        self._requests.append((kind, dof, delay))

    def clear(self, dof: Dof) -> None:
        """End a drive's faults; one that is in the fault state stays there until it is reset."""
        self._requests.append((None, dof, 0.0))

    @property
    def events(self) -> list[Event]:
        """What the drives did, in order."""
        return list(self._events)

    @property
    def states(self) -> Mapping[Dof, State]:
        """The state of each drive."""
        return {dof: self._drives[dof].status for dof in Dof}

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop()

    def _run(self) -> None:
        try:
            for drive in self._drives:
                drive.boot(time.monotonic())
            while not self._ending.is_set():
                self._turn()
        except BaseException as error:
            self.failure = error

    def _turn(self) -> None:
        due = min(drive.deadline() for drive in self._drives)
        if self._late:
            due = min(due, self._late[0][0])
        message = self._receive(min(max(due - time.monotonic(), 0.0), 0.05))
        now = time.monotonic()
        while self._requests:
            self._request(*self._requests.popleft(), now)
        if message is not None and not message.is_error_frame:
            identifier, data = message.arbitration_id, bytes(message.data)
            for dof, drive in zip(Dof, self._drives, strict=True):
                if "drop" not in self._faults[dof]:
                    drive.take(identifier, data, now)
            if identifier == 0x080:
                self._plant()
        for drive in self._drives:
            drive.tick(now)
        while self._late and self._late[0][0] <= now:
            self._transmit(heapq.heappop(self._late)[2])

    def _receive(self, patience: float) -> can.Message | None:
        """A frame, if one comes; drives whose bus is unplugged go on by themselves."""
        if not self._unplugged:
            try:
                return self._bus.recv(patience)
            except can.CanError:
                self._unplugged = True
        time.sleep(patience)
        return None

    def _transmit(self, message: can.Message) -> None:
        if not self._unplugged:
            try:
                self._bus.send(message)
            except can.CanError:
                self._unplugged = True

    def _plant(self) -> None:
        if not any(drive.state == OPERATIONAL for drive in self._drives):
            return
        told = np.array([drive.scale.to_position(drive.demand) for drive in self._drives])
        actual = told if self._on_sync is None else self._on_sync(told)
        for dof, drive in zip(Dof, self._drives, strict=True):
            if "freeze" not in self._faults[dof]:
                drive.set_actual(drive.scale.to_counts(float(actual[dof])))

    def _request(self, kind: FaultKind | None, dof: Dof, delay: float, now: float) -> None:
        drive = self._drives[dof]
        if kind is None:
            self._faults[dof].clear()
            drive.refusing = False
        else:
            self._faults[dof][kind] = delay
            self._logger(dof)(now, f"fault: {kind}")
            if kind == "fault":
                drive.fail(now)
            drive.refusing |= kind == "refuse"
            if kind == "refuse":
                drive.values[0x6061, 0] = 0

    def _sender(self, dof: Dof) -> Send:
        def send(identifier: int, data: bytes) -> None:
            faults = self._faults[dof]
            if "drop" in faults or ("heartbeat" in faults and identifier >= 0x700):
                return
            message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
            if "delay" in faults:
                due = time.monotonic() + faults["delay"]
                heapq.heappush(self._late, (due, next(self._order), message))
            else:
                self._transmit(message)

        return send

    def _logger(self, dof: Dof) -> Callable[[float, str], None]:
        def log(now: float, what: str) -> None:
            self._events.append(Event(now, dof.label, what))

        return log


def main() -> None:
    """A process of drives; see the module's text."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--config", required=True, help="TOML with a section [drives]")
    parser.add_argument("--socket", required=True, help="where to make the bus")
    parser.add_argument("--modes", type=int, nargs="+", default=[7, 8])
    parser.add_argument("--start", type=float, nargs=3, default=[0.0, 0.0, 0.0])
    arguments = parser.parse_args()
    config = load_config(arguments.config).drives
    if config is None:
        raise ConfigError("drives", None, "a section [drives]")
    start, modes = np.array(arguments.start), tuple(arguments.modes)
    with Hub(arguments.socket), LocalBus(arguments.socket) as bus:
        drives = SimulatedDrives(bus, config, start=start, modes=modes)
        with drives:
            said = _Reporter(drives)
            print(json.dumps({"time": time.monotonic(), "what": "ready"}), flush=True)
            for line in sys.stdin:
                kind, label = line.split()
                dof = Dof[label.upper()]
                drives.clear(dof) if kind == "clear" else drives.inject(kind, dof)  # type: ignore[arg-type]
        said.close()


class _Reporter:
    """Writes events as they come; a thread, as the main one waits for its input."""

    def __init__(self, drives: SimulatedDrives) -> None:
        self._drives = drives
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        told = 0
        last = False
        while not last:
            last = self._ending.wait(0.02)
            for event in self._drives.events[told:]:
                told += 1
                line = {"time": event.time, "dof": event.dof, "what": event.what}
                print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
