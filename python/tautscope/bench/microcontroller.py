"""A simulated microcontroller with motors behind a pseudo-terminal, with fault injection.

with SimulatedMicrocontroller(config, plant): ...  # a client opens drives.channel
"""

import math
from typing import Any

from tautscope.bench.line_motors import LineMotors
from tautscope.bench.serial_board import SerialBoard
from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.hardware.serial_line import frames
from tautscope.hardware.serial_line.frames import FAULTS, Limits, Request, State

_LIMIT = 1 << 30
_DRIVER = 1


class SimulatedMicrocontroller(LineMotors):
    """Motors with encoders that count from where each DOF is at its ``home``; see `LineMotors`.

    Their faults: drop: the microcontroller neither sends nor receives. delay: it answers late.
    fault: a motor's driver reports one. freeze: a motor is blocked. restart: the microcontroller
    restarts, and counts from where the motors are then. unplug: the adapter is gone.
    """

    def __init__(self, config: DrivesConfig, *arguments: Any, **options: Any) -> None:
        super().__init__(config, *arguments, **options)
        self._at = [config[dof].node - 1 for dof in config.all_motors]
        self.shafts = list(self._start)
        """Where the motors are [counts from home]."""
        self._blocked: set[Motor] = set()
        self._limits = [Limits(-_LIMIT, _LIMIT, 0)] * (max(self._at) + 1)
        for at, scale in zip(self._at, self._scales, strict=True):
            self._limits[at] = Limits(-_LIMIT, _LIMIT, scale.speed_counts())
        self._switch_on([0] * len(self._scales))

    def _switch_on(self, zeros: list[int]) -> None:
        self.board = SerialBoard(self._limits)
        self._zeros = zeros
        self._demands = [float(shaft) for shaft in self.shafts]
        self._publish()

    def _publish(self) -> None:
        for at, shaft, zero in zip(self._at, self.shafts, self._zeros, strict=True):
            self.board.positions[at] = shaft - zero

    def _process(self, now: float) -> None:
        before, milliseconds = self.board.state, math.floor(1e3 * now)
        is_silent = any("drop" in faults for faults in self._faults.values())
        late = sum(faults.get("delay", 0.0) for faults in self._faults.values())
        self.board.poll(milliseconds)
        for message in frames.take_messages(self._buffer, frames.LONGEST_REQUEST):
            if is_silent:
                continue
            if message[0] == Request.SETPOINTS:
                self._begin_cycle(now)
            answer = self.board.answer(message, milliseconds)
            self._queue(now + late + self._wire_time(len(message) + len(answer)), answer)
        if self.board.state != before:
            for dof in self._config.all_motors:
                self._log(dof, now, self.board.state.name.lower())

    def _due(self) -> float:
        if self.board.state != State.ENABLED:
            return math.inf
        return 1e-3 * (self.board.heard_at + self.board.watchdog)

    def _advance(self, period: float, now: float) -> list[int]:
        for dof, at in enumerate(self._at):
            goal = self.board.targets[at] + self._zeros[dof]
            step = self._limits[at].speed * period
            if self.board.state == State.ENABLED:
                self._demands[dof] += min(max(goal - self._demands[dof], -step), step)
        return list(map(round, self._demands))

    def _move(self, shafts: list[int]) -> None:
        for dof in self._config.all_motors:
            if dof not in self._blocked:
                self.shafts[dof] = shafts[dof]
        self._publish()

    def _apply(self, kind: str, dof: Motor, now: float) -> None:
        if kind == "fault":
            self.board.faults[self._at[dof]] = _DRIVER
            self._log(dof, now, f"fault: {FAULTS[_DRIVER]}")
        elif kind == "freeze":
            self._blocked.add(dof)
        elif kind == "restart":
            self._switch_on(list(self.shafts))
            self._log(dof, now, "restart")
        elif kind == "unplug":
            self._unplug()

    def _recover(self, dof: Motor) -> None:
        super()._recover(dof)
        self._blocked.discard(dof)
        self.board.faults[self._at[dof]] = 0
