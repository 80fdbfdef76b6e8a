"""What all simulated motors have in common: a thread, faults on request, events."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from tautscope.bench.events import Event
from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import ConfigError

Kind = TypeVar("Kind", bound=str)
OnCycle = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""The plant: demanded positions (n,) [m or rad] to positions; called once per cycle of the
client (on CAN per SYNC, after the TxPDOs are sent), and by the clock where none cycles."""


class SimulatedMotors(ABC, Generic[Kind]):
    """Motors on one bus, in a thread; a context manager.

    Leaving it switches their power off and raises the error that ended the thread, if any.

    Args:
        config: The true rig.
        kinds: The faults that they know.
    """

    def __init__(self, config: DrivesConfig, kinds: tuple[Kind, ...]) -> None:
        self._config = config
        self._kinds = kinds
        self._events: list[Event] = []
        self._requests: deque[tuple[Kind | None, Motor, float]] = deque()
        self._faults: dict[Motor, dict[Kind, float]] = {dof: {} for dof in self._config.all_motors}
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=type(self).__name__, daemon=True)
        self._failure: BaseException | None = None

    def inject(self, kind: Kind, dof: Motor, delay: float = 0.3) -> None:
        """Inject a fault; `delay` [s] applies to the kind ``delay``.

        Raises:
            ConfigError: There is no such fault.
        """
        if kind not in self._kinds:
            raise ConfigError("fault", kind, "one of " + ", ".join(self._kinds))
        self._requests.append((kind, dof, delay))

    def clear(self, dof: Motor) -> None:
        """End the faults of a motor; a fault that it reports remains until it is reset."""
        self._requests.append((None, dof, 0.0))

    @property
    def events(self) -> list[Event]:
        """All events, in order."""
        return list(self._events)

    def log_event(self, source: str, what: str) -> None:
        """Add an event of another part of the bench."""
        self._events.append(Event(time.monotonic(), source, what))

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *failure: object) -> None:
        self._stopping.set()
        self._thread.join()
        if self._failure is not None:
            raise self._failure

    def _run(self) -> None:
        try:
            self._begin()
            while not self._stopping.is_set():
                self._process_next()
        except BaseException as error:
            self._failure = error

    @abstractmethod
    def _begin(self) -> None:
        """Power on."""

    @abstractmethod
    def _process_next(self) -> None:
        """Wait for what comes next, and process it."""

    @abstractmethod
    def _apply(self, kind: Kind, dof: Motor, now: float) -> None:
        """Begin a fault."""

    @abstractmethod
    def _recover(self, dof: Motor) -> None:
        """End the faults of a motor."""

    def _apply_requests(self, now: float) -> None:
        while self._requests:
            kind, dof, delay = self._requests.popleft()
            if kind is None:
                self._faults[dof].clear()
                self._recover(dof)
            else:
                self._faults[dof][kind] = delay
                self._logger(dof)(now, f"fault: {kind}")
                self._apply(kind, dof, now)

    def _logger(self, dof: Motor) -> Callable[[float, str], None]:
        def log(now: float, what: str) -> None:
            self._events.append(Event(now, dof.label, what))

        return log
