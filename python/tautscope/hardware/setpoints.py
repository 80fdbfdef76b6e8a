"""Set-points at a steady rate, sent by a thread of its own."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import StateError
from tautscope.hardware.realtime import SETPOINTS, realtime
from tautscope.hardware.timing import Timing
from tautscope.hardware.watch import outside_travel

Floats = NDArray[np.float64]
_PATIENCE = 0.3
"""How long a cycle waits for a command that is late [share of the cycle]."""


class Motors(AbstractContextManager["Motors"], Protocol):
    """What `tautscope.hardware.drives.Drives` is to this thread."""

    def start(self) -> Floats:
        """Enable; where the motors are (3,) [m, rad, rad]."""
        ...

    def exchange(self, command: ArrayLike) -> Floats:
        """Send a set-point (3,), and read where the motors are (3,) [m, rad, rad]."""
        ...

    def disable(self) -> None:
        """Quick stop, then take the power from the motors."""
        ...


class Setpoints:
    """Opens the drives, goes to the start, and sends a set-point in every cycle.

    The cycles lie on a grid. A command that comes too late for one cycle goes with the next, and
    the motors are held meanwhile; a cycle for which the thread itself woke too late is left out.
    Neither is made up for. Without a command for ``command_timeout``, or when the main thread has
    ended, the motors are brought to quick stop.

    Args:
        config: Cycle, limits, times.
        motors: Opens the drives; called in the thread, the only one that uses them.
        start: (3,) where to go first [m, rad, rad].
        timing: Told every cycle from the start on.
    """

    def __init__(
        self, config: DrivesConfig, motors: Callable[[], Motors], start: Floats, timing: Timing
    ) -> None:
        self._config = config
        self._motors = motors
        self._start = start
        self._timing = timing
        self._news = threading.Condition()
        self._command: Floats | None = None
        self._sent: tuple[float, Floats] | None = None
        self._has_begun = self._is_ending = self._is_over = self._is_told = False
        self._is_abandoned = self._is_disabling = False
        self._failure: BaseException | None = None
        self._due = 0.0
        self._patience = _PATIENCE * config.cycle
        self._thread = threading.Thread(target=self._run, name="set-points")

    def start(self) -> Floats:
        """Go to the start; where the motors are then (3,) [m, rad, rad].

        Raises:
            TautscopeError: What opening, enabling or moving raised; the motors are stopped.
        """
        self._thread.start()
        with self._news:
            return self._take()[1]

    def send(self, command: Floats) -> tuple[float, Floats]:
        """Hand over the next set-point and wait until it was sent and answered.

        Returns:
            When it was sent [s, monotonic clock], and where the motors are (3,).

        Raises:
            StateError: Stopped, before or meanwhile.
            TautscopeError: What the drives raised; the motors are stopped.
        """
        with self._news:
            self._command = command
            self._news.notify_all()
            return self._take()

    def stop(self, *, disable: bool = False) -> None:
        """Quick stop, confirmed by the drives, and the bus released; may be called twice.

        Args:
            disable: Take the power from the motors too.

        Raises:
            TautscopeError: What went wrong in the thread, if nobody was told yet.
        """
        with self._news:
            self._is_ending, self._is_disabling = True, disable
        if self._thread.ident is not None:
            self._thread.join()
        if not (self._is_told or self._is_abandoned):
            self._check()

    def _take(self) -> tuple[float, Floats]:
        self._news.wait_for(lambda: self._sent is not None or self._is_over)
        self._check()
        if self._sent is None:
            raise StateError("drives", "a command after the stop", "Call reset to start again")
        sent, self._sent = self._sent, None
        return sent

    def _check(self) -> None:
        if self._failure is not None:
            self._is_told = True
            raise self._failure

    # The thread

    def _run(self) -> None:
        failure: BaseException | None = None
        try:
            with realtime(SETPOINTS) as self._timing.realtime, self._motors() as motors:
                self._approach(motors, motors.start())
                self._follow(motors)
                if self._is_disabling:
                    motors.disable()
        except BaseException as error:
            failure = error
        with self._news:
            self._failure, self._is_over = failure, True
            self._news.notify_all()

    def _approach(self, motors: Motors, position: Floats) -> None:
        """From where the motors are to the start, slowly, without a jump in speed."""
        config = self._config
        for dof in Dof:
            axis, at = config[dof], float(position[dof])
            if not axis.travel[0] <= at <= axis.travel[1]:
                raise outside_travel(f"{dof.label}, node {axis.node}", dof, at, axis.travel)
        way = self._start - position
        speeds = np.array([config[dof].speed_limit for dof in Dof]) * config.start_speed
        # The cosine's largest speed is pi / 2 times its mean.
        duration = float(np.max(np.abs(way) / speeds)) * math.pi / 2
        count = math.ceil(duration / config.cycle) + 1
        self._due = time.monotonic()
        applied = position
        for number in range(count + 1):
            share = (1 - math.cos(math.pi * number / count)) / 2
            applied = motors.exchange(position + share * way)
            if self._must_end():
                return
            self._next_cycle()
        with self._news:
            self._sent = self._due, applied
            self._news.notify_all()

    def _follow(self, motors: Motors) -> None:
        command, last_news = self._start, time.monotonic()
        while not self._must_end():
            with self._news:
                if self._has_begun:
                    self._news.wait_for(lambda: self._command is not None, self._patience)
                taken, self._command = self._command, None
            began = time.monotonic()
            if taken is not None:
                command, last_news, self._has_begun = taken, began, True
            elif began - last_news > self._config.command_timeout:
                self._is_abandoned = True
                raise StateError(
                    "loop",
                    f"no command for {began - last_news:.2g} s",
                    "Find what holds it up, or raise drives.command_timeout; the motors are "
                    "stopped",
                )
            applied = motors.exchange(command)
            if self._has_begun:
                self._timing.add_cycle(self._due, began, time.monotonic(), taken is not None)
            if taken is not None:
                with self._news:
                    self._sent = began, applied
                    self._news.notify_all()
            self._next_cycle()

    def _must_end(self) -> bool:
        return self._is_ending or not threading.main_thread().is_alive()

    def _next_cycle(self) -> None:
        """Sleep until the next instant of the grid that is not past yet."""
        cycle = self._config.cycle
        self._due += cycle
        late = math.floor((time.monotonic() - self._due) / cycle)
        if late > 0:
            self._due += late * cycle
        time.sleep(max(0.0, self._due - time.monotonic()))
