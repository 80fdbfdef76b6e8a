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
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Literal, Self, get_args

import can
import numpy as np
from numpy.typing import NDArray

from tautscope.bench.can_bus import Hub, LocalBus
from tautscope.bench.canopen_node import OPERATIONAL, Send
from tautscope.bench.drive import SimulatedDrive
from tautscope.bench.events import Event, Reporter
from tautscope.config import DrivesConfig, load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.hardware.cia402 import State

FaultKind = Literal["drop", "delay", "fault", "freeze", "heartbeat", "refuse"]
"""drop: says and hears nothing. delay: says everything late. fault: emergency, then fault state.
freeze: its position stands still, whatever it is told. heartbeat: no more heartbeats. refuse:
takes no mode from now on."""

OnSync = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Takes where the motors are told to be (3,) [m, rad, rad] and gives where they are; called once
per SYNC, after the drives have answered it."""


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

    def note(self, who: str, what: str) -> None:
        """Put what something else on the bench did among the events."""
        self._events.append(Event(time.monotonic(), who, what))

    @property
    def states(self) -> Mapping[Dof, State]:
        """The state of each drive."""
        return {dof: self._drives[dof].status for dof in Dof}

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *failure: object) -> None:
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
            said = Reporter(lambda: drives.events)
            print(json.dumps({"time": time.monotonic(), "what": "ready"}), flush=True)
            for line in sys.stdin:
                kind, label = line.split()
                dof = Dof[label.upper()]
                drives.clear(dof) if kind == "clear" else drives.inject(kind, dof)  # type: ignore[arg-type]
        said.close()


if __name__ == "__main__":
    main()
