"""One trial: simulated motors, a controller in a process of its own, and something that happens.

The motors run in a thread of this process, which records where they are in each cycle; the
controller is forked, so that it can be killed, stopped and paused.
"""

import math
import multiprocessing
import os
import random
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tautscope.bench.any_motors import make_motors
from tautscope.bench.motors import SimulatedMotors
from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import DriveError
from tautscope.hardware.drives import Drives, open_drives, open_group
from tautscope.hardware.signals import exit_on_signals

SPEED = 1.5
"""Largest speed of a motor [rad/s]."""
BEFORE = (0.3, 1.3)
"""When something happens after the first set-point, between these times [s]."""
WATCHED = 1.6
"""How long it is watched [s]."""
FORK = multiprocessing.get_context("fork")
STOPPED = ("quick stop active", "bus watchdog", "silence")
"""Events of motors that stop by themselves, or are told to: CiA 402, Dynamixel, serial line."""


@dataclass
class Trial:
    """What runs, for what happens to it; and what was recorded.

    Attributes:
        controller: Process id.
        motors: The simulated motors.
        config: Theirs.
        second: Lets another program begin; False lets it take the lock as every program does.
        positions: Time [s] and positions (n,) [rad] of each cycle.
        happened: Time [s].
        said: What the controller, and the other program, sent last.
    """

    controller: int
    motors: SimulatedMotors
    config: DrivesConfig
    second: Connection
    positions: list[tuple[float, NDArray[np.float64]]] = field(default_factory=list)
    happened: float = 0.0
    said: list[dict[str, Any]] = field(default_factory=lambda: [{}, {}])

    @property
    def labels(self) -> tuple[Motor, ...]:
        """All motors."""
        return self.config.all_motors

    @property
    def one(self) -> Motor:
        """The motor to which something happens."""
        return self.labels[1]

    @property
    def is_disturbed(self) -> bool:
        """Whether the controller ended before anything happened: the computer was too busy."""
        return self.said[0].get("at", math.inf) < self.happened

    def signal(self, number: int) -> None:
        """Send a signal to the controller."""
        os.kill(self.controller, number)

    def inject(self, kind: str, *, every: bool = False) -> None:
        """Inject a fault into one motor, or every one."""
        for motor in self.labels if every else (self.one,):
            self.motors.inject(kind, motor)  # type: ignore[arg-type]

    def moved(self) -> tuple[NDArray[np.float64], float]:
        """How far each motor went (n,) [rad], and how long any of them moved [s], from then on."""
        before = [at for now, at in self.positions if now <= self.happened]
        after = [(now, at) for now, at in self.positions if now > self.happened]
        if not before or not after:
            return np.zeros(len(self.labels)), 0.0
        where = np.array([at for _, at in after])
        is_moving = np.any(where != where[-1], axis=1)
        last = np.flatnonzero(is_moving)[-1] + 1 if is_moving.any() else None
        took = 0.0 if last is None else after[last][0] - self.happened
        return np.abs(where - before[-1]).max(axis=0), took

    def stopped(self) -> list[float]:
        """When each motor stopped [s after it happened], infinite if it never did."""
        events = self.motors.events
        times = {event.dof: event.time - self.happened for event in events if event.what in STOPPED}
        return [times.get(motor.label, math.inf) for motor in self.labels]


def trial(
    motors: DrivesConfig,
    controller: DrivesConfig,
    happens: Callable[[Trial], None] | None,
    seconds: float = 60.0,
) -> Trial:
    """Run motors and a controller until it ends, or for `WATCHED` after something happens.

    Args:
        motors: The true motors.
        controller: The same, or what the controller believes.
        happens: Called at a random time; None if the controller streams for `seconds`.
        seconds: Duration of the stream.
    """
    with _forked(_control, controller, seconds) as (process, pipe), ExitStack() as resources:
        _, second = resources.enter_context(_forked(_intrude, controller))
        positions: list[tuple[float, NDArray[np.float64]]] = []

        def record(demand: NDArray[np.float64]) -> NDArray[np.float64]:
            positions.append((time.monotonic(), demand))
            return demand

        count = len(motors.all_motors)
        running = make_motors(motors, resources, record, start=np.zeros(count))
        resources.enter_context(running)
        found = Trial(process, running, motors, second, positions)
        found.happened = time.monotonic()
        pipe.send(None)
        first = pipe.recv()  # the positions at the start, or an error
        if "error" not in first and happens is not None:
            time.sleep(random.uniform(*BEFORE))
            found.happened = time.monotonic()
            happens(found)
        timeout = WATCHED if happens is not None else seconds + WATCHED
        found.said = [first or _said(pipe, timeout), _said(second, 0.0)]
        # Twice the timeout, to tell a watchdog that is late from one that never stops its motor.
        watched = max(WATCHED / 2, 2 * motors.heartbeat_timeout)
        time.sleep(max(0.0, found.happened + watched - time.monotonic()))
    return found


def _said(pipe: Connection, timeout: float) -> dict[str, Any]:
    """What a process sends within a timeout [s]; nothing if it was killed."""
    try:
        found: dict[str, Any] = pipe.recv() if pipe.poll(timeout) else {}
    except EOFError:
        return {}
    return found


def stream(drives: Drives, seconds: float, begin: NDArray[np.float64], took: list[float]) -> None:
    """Send set-points at the rate of the drives; add the duration of each exchange [ms]."""
    start = time.monotonic()
    for count in range(round(seconds / drives.cycle)):
        due = start + count * drives.cycle
        time.sleep(max(0.0, due - time.monotonic()))
        phase = 2 * np.pi * 0.5 * count * drives.cycle
        before = time.perf_counter()
        drives.exchange(begin + SPEED / np.pi * np.sin(phase))
        took.append((time.perf_counter() - before) * 1e3)


def _control(pipe: Connection, config: DrivesConfig, seconds: float) -> None:
    """Stream set-points; send what was measured, and how it ended."""
    pipe.recv()
    took: list[float] = []
    said: dict[str, Any] = {"took": took, "error": ""}
    drives: Drives | None = None
    try:
        with exit_on_signals(), open_drives(config) as drives:
            begin = drives.start()
            pipe.send({})
            stream(drives, seconds, begin, took)
    except DriveError as error:
        notes = getattr(error, "__notes__", [])
        said |= {"error": type(error).__name__, "message": " ".join([str(error), *notes])}
    said["at"] = time.monotonic()
    said["traffic"] = None if drives is None else drives.statistics
    pipe.send(said)


def _intrude(pipe: Connection, config: DrivesConfig) -> None:
    """Command the same motors, without the lock if that was sent, else as every program."""
    ignores_lock = pipe.recv()
    said = ""
    try:
        if ignores_lock:
            group = open_group(config)
            at = group.read_positions()
            group.start(at)
            group.enable(reset_faults=False)
            while True:
                group.exchange(at)
                time.sleep(config.cycle)
        with open_drives(config):
            pass
    except DriveError as error:
        said = type(error).__name__
    pipe.send({"error": said})


@contextmanager
def _forked(target: Callable[..., None], *arguments: Any) -> Iterator[tuple[int, Connection]]:
    """A process that does nothing before it is told to, and is killed at the end."""
    pipe, end = FORK.Pipe()
    process = FORK.Process(target=target, args=(end, *arguments), daemon=True)
    process.start()
    end.close()
    try:
        yield process.pid or 0, pipe
    finally:
        process.kill()
        process.join()
