"""A thread that sends set-points to the drives at a constant rate."""

import math
import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tautscope.config import DrivesConfig
from tautscope.errors import StateError
from tautscope.hardware.drives import Drives
from tautscope.hardware.realtime import SETPOINTS, realtime
from tautscope.hardware.signals import defer_signals
from tautscope.hardware.timing import Timing

Floats = NDArray[np.float64]
_COMMAND_WAIT = 0.3
"""How long a cycle waits for a late command [fraction of the cycle]."""


class SetpointThread:
    """Opens the drives, moves them to the start, and sends one set-point per cycle.

    The cycles lie on a fixed time grid. A command that is late for one cycle is sent in the next,
    and the last set-point is repeated meanwhile; a cycle for which the thread wakes too late is
    skipped. Lost cycles are not caught up. The motors are quick-stopped without a command for
    ``command_timeout`` and when the main thread ends. `start` and `send` raise what the drives
    raise, whose motors are then stopped, and `StateError` after a stop.

    Args:
        config: Cycle, limits, timeouts.
        motors: Opens the drives; called in the thread, the only one that uses them.
        start: (n,) start position [m or rad]; None if the motors stay where they are.
        timing: Records every cycle from the first command on.
    """

    def __init__(
        self,
        config: DrivesConfig,
        motors: Callable[[], Drives],
        start: Floats | None,
        timing: Timing,
    ) -> None:
        self._config = config
        self._motors = motors
        self._start = start
        self._timing = timing
        self._condition = threading.Condition()
        self._command: Floats | None = None
        self._sent: tuple[float, Floats] | None = None
        self._has_begun = self._is_stopping = self._is_over = self._is_reported = False
        self._has_timed_out = self._is_disabling = self._is_disabled = False
        self._failure: BaseException | None = None
        self._due = 0.0
        self._command_wait = _COMMAND_WAIT * config.cycle
        self._thread = threading.Thread(target=self._run, name="set-points")

    def start(self) -> Floats:
        """Move to the start; the positions reached (n,) [m or rad].

        Raises:
            TautscopeError: The drives failed; the motors are stopped.
        """
        self._thread.start()
        with self._condition:
            return self._wait_for_answer()[1]

    def send(self, command: Floats) -> tuple[float, Floats]:
        """Queue the next set-point and wait until it is sent and answered.

        Returns:
            Time at which it was sent [s, monotonic clock], and the positions (n,) [m or rad].
        """
        with self._condition:
            self._command = command
            self._condition.notify_all()
            return self._wait_for_answer()

    def interrupt(self) -> None:
        """Quick-stop the motors in the present cycle; for any thread.

        `start` or `send`, if one waits, raises `StateError`. Call `stop` afterwards.
        """
        self._is_stopping = True

    def stop(self, *, disable: bool = False) -> None:
        """Quick-stop the motors and release the bus; a second call does nothing.

        Args:
            disable: Disable voltage too.

        Raises:
            TautscopeError: The thread failed, and the failure was not raised before; no command for
                ``command_timeout`` is none, if the quick stop was confirmed.
            StateError: The motors were stopped before, without disabling voltage.
        """
        with self._condition:
            self._is_stopping, self._is_disabling = True, disable
        if self._thread.ident is None:
            return
        with defer_signals():
            self._thread.join()
            if not (self._is_reported or self._has_timed_out):
                self._raise_failure()
            if disable and not self._is_disabled:
                raise StateError(
                    "drives",
                    "they were stopped before, and may hold the motors: voltage is not disabled",
                    "Switch their supply off",
                )

    def _wait_for_answer(self) -> tuple[float, Floats]:
        self._condition.wait_for(lambda: self._sent is not None or self._is_over)
        self._raise_failure()
        if self._sent is None:
            raise StateError("drives", "a command after the stop", "Call reset() to start again")
        sent, self._sent = self._sent, None
        return sent

    def _raise_failure(self) -> None:
        if self._failure is not None:
            self._is_reported = True
            raise self._failure

    def _run(self) -> None:
        failure: BaseException | None = None
        try:
            with realtime(SETPOINTS) as self._timing.realtime, self._motors() as motors:
                if not self._must_stop():  # a stop while they were opened leaves them off
                    self._move_to_start(motors, motors.start())
                    self._stream(motors)
                if self._is_disabling:
                    motors.disable()
                    self._is_disabled = True
        except BaseException as error:
            failure = error
        with self._condition:
            self._failure, self._is_over = failure, True
            self._condition.notify_all()

    def _move_to_start(self, motors: Drives, position: Floats) -> None:
        """Move along half a cosine to the start, at `start_speed` of the speed limits at most."""
        config = self._config
        self._start = position if self._start is None else self._start
        distance = self._start - position
        speeds = (
            np.array([config[dof].speed_limit for dof in self._config.all_motors])
            * config.start_speed
        )
        # The peak speed of the cosine is pi / 2 times its mean.
        duration = float(np.max(np.abs(distance) / speeds)) * math.pi / 2
        count = math.ceil(duration / config.cycle) + 1
        self._due = time.monotonic()
        applied = position
        for number in range(count + 1):
            fraction = (1 - math.cos(math.pi * number / count)) / 2
            applied = motors.exchange(position + fraction * distance)
            if self._must_stop():
                return
            self._next_cycle()
        with self._condition:
            self._sent = self._due, applied
            self._condition.notify_all()

    def _stream(self, motors: Drives) -> None:
        assert self._start is not None
        command, last_command_at = self._start, time.monotonic()
        while not self._must_stop():
            with self._condition:
                if self._has_begun:
                    self._condition.wait_for(lambda: self._command is not None, self._command_wait)
                new, self._command = self._command, None
            began = time.monotonic()
            if new is not None:
                command, last_command_at, self._has_begun = new, began, True
            elif began - last_command_at > self._config.command_timeout:
                motors.stop()  # an error of its own if it is not confirmed
                self._has_timed_out = True
                raise StateError(
                    "loop",
                    f"no command for {began - last_command_at:.2g} s",
                    "The motors are stopped. Find what delays the loop, or raise "
                    "drives.command_timeout",
                )
            applied = motors.exchange(command)
            if self._has_begun:
                self._timing.add_cycle(self._due, began, time.monotonic(), new is not None)
            if new is not None:
                with self._condition:
                    self._sent = began, applied
                    self._condition.notify_all()
            self._next_cycle()

    def _must_stop(self) -> bool:
        return self._is_stopping or not threading.main_thread().is_alive()

    def _next_cycle(self) -> None:
        """Sleep until the next point of the time grid in the future."""
        cycle = self._config.cycle
        self._due += cycle
        late = math.floor((time.monotonic() - self._due) / cycle)
        if late > 0:
            self._due += late * cycle
        time.sleep(max(0.0, self._due - time.monotonic()))
