"""Simulated motors behind a pseudo-terminal, which a client opens as a serial port.

The motors move by themselves, as long as they have power: after each cycle of a client, and by the
clock when no client cycles.
"""

import fcntl
import math
import os
import select
import struct
import time
import tty
from abc import abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from tautscope.bench.motors import SimulatedMotors
from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import ConfigError

_IDLE = 0.005
"""How often the line is looked at while no client has it open [s]."""

_TCGETS2 = 0x802C542A
"""ioctl(2): settings of a terminal with any bit rate (struct termios2), which `termios` lacks."""


class LineMotors(SimulatedMotors):
    """Motors on one line, which the `stops` of their configuration stop.

    ``drives.channel`` becomes a link to the pseudo-terminal, which entering them makes.

    Raises:
        ConfigError: The link cannot be made.
    """

    kinds = ("drop", "delay", "fault", "freeze", "restart", "unplug")

    def __init__(self, config: DrivesConfig, *arguments: Any, **options: Any) -> None:
        super().__init__(config, *arguments, **options)
        stops = [config[dof].stops or (-math.inf, math.inf) for dof in config.all_motors]
        self._lowest, self._highest = np.transpose(stops)
        self._has_goals = False
        self._buffer = bytearray()
        self._stepped_at = 0.0
        self._link = Path(config.channel)

    def __enter__(self) -> Self:
        lock = None
        try:
            # The lock ends with the process; a link of one that was killed stays.
            lock = os.open(f"{self._link}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._line = self._plug_in()
        except OSError as error:
            if lock is not None:
                os.close(lock)
            allowed = f"a link that can be made ({error}); is another bench running?"
            raise ConfigError("drives.channel", str(self._link), allowed) from None
        self._lock = lock
        return super().__enter__()

    def __exit__(self, *failure: object) -> None:
        try:
            super().__exit__(*failure)
        finally:
            self._link.unlink(missing_ok=True)
            os.close(self._line)
            os.close(self._lock)

    @abstractmethod
    def _process(self, now: float) -> None:
        """Take what is complete in `_buffer`, `_queue` the answers, `_begin_cycle` if cycled."""

    @abstractmethod
    def _advance(self, period: float, now: float) -> list[int]:
        """Advance the position loops by a period [s]; the demanded positions [counts]."""

    @abstractmethod
    def _move(self, shafts: list[int]) -> None:
        """Take note of the positions that the plant has reached [counts]."""

    def _due(self) -> float:
        """When something must happen without a byte from the client [s]."""
        return math.inf

    def _wire_time(self, size: int) -> float:
        """How long so many bytes take on the line [s]."""
        return 10 * size / self._config.bitrate

    def _plug_in(self) -> int:
        """Open a pseudo-terminal, and make the link to it."""
        line, end = os.openpty()
        try:
            tty.setraw(end)
            if self._link.is_symlink():
                self._link.unlink()
            self._link.symlink_to(os.ttyname(end))
        except OSError:
            os.close(line)
            raise
        finally:
            os.close(end)  # so that a client's exclusive lock ends with the client
        os.set_blocking(line, False)
        return line

    def _begin(self) -> None:
        self._stepped_at = time.monotonic()

    def _process_next(self) -> None:
        due = min(self._stepped_at + 1.5 * self._config.cycle, self._due(), self._queued_at())
        self._receive(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        self._apply_requests(now)
        self._process(now)
        self._transmit_queued()
        has_cycled = self._has_goals and not self._queued
        if has_cycled or now >= self._stepped_at + 1.5 * self._config.cycle:
            self._step(now, has_cycled=has_cycled)

    def _receive(self, timeout: float) -> None:
        readable, _, _ = select.select([self._line], [], [], timeout)
        if not readable:
            return
        try:
            self._buffer += os.read(self._line, 4096)
            if self._rate() != self._config.bitrate:  # noise to the motors
                self._buffer.clear()
        except OSError:  # no client has the other end open
            self._buffer.clear()
            time.sleep(_IDLE)

    def _unplug(self) -> None:
        """Take the adapter away: the client's port is gone, the motors go on."""
        self._link.unlink(missing_ok=True)
        lost, (self._line, end) = self._line, os.openpty()
        os.close(end)
        os.close(lost)

    def _recover(self, dof: Motor) -> None:
        is_unplugged = any("unplug" in faults for faults in self._faults.values())
        if not is_unplugged and not self._link.is_symlink():
            lost, self._line = self._line, self._plug_in()
            os.close(lost)

    def _rate(self) -> int:
        """The bit rate that the client has set [bit/s]."""
        settings = fcntl.ioctl(self._line, _TCGETS2, bytes(44))
        return int(struct.unpack("4IB19s2I", settings)[-1])

    def _transmit(self, data: bytes) -> None:
        with suppress(OSError):  # the client is gone
            os.write(self._line, data)

    def _begin_cycle(self, now: float) -> None:
        """Call before new set-points: of several that are read together, each moves the motors."""
        if self._has_goals:
            self._step(now, has_cycled=True)
        self._has_goals = True

    def _step(self, now: float, *, has_cycled: bool) -> None:
        # Without a client's cycles the clock counts, and a late step does not move the grid.
        self._stepped_at = now if has_cycled else self._stepped_at + self._config.cycle
        if now - self._stepped_at > 1.0:
            self._stepped_at = now
        self._has_goals = False
        demand = self._to_positions(self._advance(self._config.cycle, now))
        demand = np.clip(demand, self._lowest, self._highest)
        self._move(self._to_counts(demand if self._on_cycle is None else self._on_cycle(demand)))
