"""What all simulated motors have in common: a thread, a plant, faults on request, events."""

import heapq
import itertools
import math
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from tautscope.bench.events import Event
from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import ConfigError
from tautscope.hardware.scale import Scale

OnCycle = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""The plant: demanded positions (n,) [m or rad] to positions; called once per cycle of the
client (on CAN per SYNC, after the TxPDOs are sent), and by the clock where none cycles."""


class SimulatedMotors(ABC):
    """Motors on one bus, in a thread; a context manager.

    Leaving it switches their power off.

    Args:
        config: The true rig, which may differ from the master's configuration.
        on_cycle: The plant; without it, the motors follow ideally.
        start: (n,) positions at power-on [m or rad]; zeros by default.
    """

    kinds: ClassVar[tuple[str, ...]]
    """The faults that they know."""

    def __init__(
        self,
        config: DrivesConfig,
        on_cycle: OnCycle | None = None,
        *,
        start: NDArray[np.float64] | None = None,
    ) -> None:
        self._config, self._on_cycle = config, on_cycle
        self._scales = [Scale(config[dof], dof) for dof in config.all_motors]
        self._start = self._to_counts(np.zeros(len(self._scales)) if start is None else start)
        self._events: list[Event] = []
        self._requests: deque[tuple[str, Motor, float]] = deque()
        self._faults: dict[Motor, dict[str, float]] = {dof: {} for dof in config.all_motors}
        self._queued: list[tuple[float, int, Any]] = []
        self._order = itertools.count()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=type(self).__name__, daemon=True)

    def inject(self, kind: str, dof: Motor, delay: float = 0.3) -> None:
        """Inject a fault; `delay` [s] applies to the kind ``delay``.

        ``clear`` ends the faults of a motor; one that it reports remains until it is reset.

        Raises:
            ConfigError: There is no such fault.
        """
        if kind not in ("clear", *self.kinds):
            raise ConfigError("fault", kind, "one of " + ", ".join(self.kinds))
        self._requests.append((kind, dof, delay))

    def request(self, line: str, *, others: tuple[str, ...] = ()) -> None:
        """Inject the fault of a line: ``freeze rotation``, ``clear rotation``.

        Args:
            line: Kind and motor.
            others: Further parts of the bench, for the error.

        Raises:
            ConfigError: There is no such fault or motor.
        """
        kind, _, name = line.partition(" ")
        named = {dof.label: dof for dof in self._config.all_motors}
        if name not in named:
            raise ConfigError("fault", line, "KIND " + ", KIND ".join([*named, *others]))
        self.inject(kind, named[name])

    def clear(self, dof: Motor) -> None:
        """End the faults of a motor."""
        self.inject("clear", dof)

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

    def _run(self) -> None:
        self._begin()
        while not self._stopping.is_set():
            self._process_next()

    @abstractmethod
    def _begin(self) -> None:
        """Power on."""

    @abstractmethod
    def _process_next(self) -> None:
        """Wait for what comes next, and process it."""

    @abstractmethod
    def _transmit(self, data: Any) -> None:
        """Send what was queued."""

    def _queue(self, at: float, data: Any) -> None:
        """Send data at a time [s]."""
        heapq.heappush(self._queued, (at, next(self._order), data))

    def _queued_at(self) -> float:
        return self._queued[0][0] if self._queued else math.inf

    def _transmit_queued(self) -> None:
        while self._queued_at() <= time.monotonic():
            self._transmit(heapq.heappop(self._queued)[2])

    @abstractmethod
    def _apply(self, kind: str, dof: Motor, now: float) -> None:
        """Begin a fault."""

    @abstractmethod
    def _recover(self, dof: Motor) -> None:
        """End the faults of a motor."""

    def _apply_requests(self, now: float) -> None:
        while self._requests:
            kind, dof, delay = self._requests.popleft()
            if kind == "clear":
                self._faults[dof].clear()
                self._recover(dof)
            else:
                self._faults[dof][kind] = delay
                self._log(dof, now, f"fault: {kind}")
                self._apply(kind, dof, now)

    def _log(self, dof: Motor, now: float, what: str) -> None:
        self._events.append(Event(now, dof.label, what))

    def _to_counts(self, positions: NDArray[np.float64]) -> list[int]:
        pairs = zip(self._scales, positions, strict=True)
        return [scale.to_counts(float(position)) for scale, position in pairs]

    def _to_positions(self, counts: Iterable[int]) -> NDArray[np.float64]:
        pairs = zip(self._scales, counts, strict=True)
        return np.array([scale.to_position(count) for scale, count in pairs])
