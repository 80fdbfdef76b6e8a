"""Simulated CiA 402 drives that move a plant, with fault injection.

with Hub(path), LocalBus(path) as bus, SimulatedDrives(bus, truth, plant) as drives: ...
"""

import time
from collections.abc import Mapping
from functools import partial

import can
import numpy as np
from numpy.typing import NDArray

from tautscope.bench.canopen_node import OPERATIONAL
from tautscope.bench.drive import SimulatedDrive
from tautscope.bench.motors import OnCycle, SimulatedMotors
from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.hardware.cia402 import State


class SimulatedDrives(SimulatedMotors):
    """Drives on one bus, which stays open.

    Their faults: drop: neither sends nor receives. delay: sends late. fault: emergency object and
    fault state. freeze: the position does not change. heartbeat: sends no heartbeats. refuse:
    accepts no mode of operation.

    `modes` are the supported modes of operation, (7,) as the article's drives; `absent` the indices
    of objects that they lack.
    """

    kinds = ("drop", "delay", "fault", "freeze", "heartbeat", "refuse")

    def __init__(
        self,
        bus: can.BusABC,
        config: DrivesConfig,
        on_cycle: OnCycle | None = None,
        *,
        start: NDArray[np.float64] | None = None,
        modes: tuple[int, ...] = (7, 8),
        absent: tuple[int, ...] = (),
    ) -> None:
        super().__init__(config, on_cycle, start=start)
        self._bus = bus
        self._drives = [
            SimulatedDrive(
                dof,
                config,
                partial(self._send, dof),
                partial(self._log, dof),
                modes=frozenset(modes),  # each is one bit
                absent=absent,
            )
            for dof in config.all_motors
        ]
        for drive, position in zip(self._drives, self._start, strict=True):
            drive.values[0x6064, 0] = position
        self._is_disconnected = False

    @property
    def states(self) -> Mapping[Motor, State]:
        """The state of each drive."""
        return {dof: self._drives[dof].status for dof in self._config.all_motors}

    def _begin(self) -> None:
        for drive in self._drives:
            drive.boot(time.monotonic())

    def _process_next(self) -> None:
        due = min(self._queued_at(), *(drive.deadline() for drive in self._drives))
        message = self._receive(min(max(due - time.monotonic(), 0.0), 0.05))
        now = time.monotonic()
        self._apply_requests(now)
        if message is not None and not message.is_error_frame:
            identifier, data = message.arbitration_id, bytes(message.data)
            for dof, drive in zip(self._config.all_motors, self._drives, strict=True):
                if "drop" not in self._faults[dof]:
                    drive.receive(identifier, data, now)
            if identifier == 0x080:
                self._step_plant()
        for drive in self._drives:
            drive.tick(now)
        self._transmit_queued()

    def _receive(self, timeout: float) -> can.Message | None:
        """Receive a frame within `timeout` [s]; without a bus the drives run on."""
        if not self._is_disconnected:
            try:
                return self._bus.recv(timeout)
            except can.CanError:
                self._is_disconnected = True
        time.sleep(timeout)
        return None

    def _transmit(self, message: can.Message) -> None:
        if not self._is_disconnected:
            try:
                self._bus.send(message)
            except can.CanError:
                self._is_disconnected = True

    def _step_plant(self) -> None:
        if not any(drive.state == OPERATIONAL for drive in self._drives):
            return
        demand = self._to_positions(drive.demand for drive in self._drives)
        actual = self._to_counts(demand if self._on_cycle is None else self._on_cycle(demand))
        for dof, faults in self._faults.items():
            if "freeze" not in faults:
                self._drives[dof].set_position(actual[dof])

    def _apply(self, kind: str, dof: Motor, now: float) -> None:
        drive = self._drives[dof]
        if kind == "fault":
            drive.fail(now)
        elif kind == "refuse":
            drive.refuses_mode = True
            drive.values[0x6061, 0] = 0

    def _recover(self, dof: Motor) -> None:
        self._drives[dof].refuses_mode = False

    def _send(self, dof: Motor, identifier: int, data: bytes) -> None:
        faults = self._faults[dof]
        if "drop" in faults or ("heartbeat" in faults and identifier >= 0x700):
            return
        message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        if "delay" in faults:
            self._queue(time.monotonic() + faults["delay"], message)
        else:
            self._transmit(message)
