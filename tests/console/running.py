"""A console of the twin: web server in a process, control loop in a thread of the tests.

Its limits of time are longer than in use, because the computer may be busy.
`tests/console/test_operator_input.py` tests those in use, `benchmarks/console` measures them.
"""

from __future__ import annotations

import json
import multiprocessing
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from console import pages
from console.pages import PERIOD
from numpy.typing import ArrayLike
from tautscope.config import Config, load_config
from tautscope.console import lease, operator_input
from tautscope.console.live_twin import LiveTwin
from tautscope.console.log_player import LogPlayer
from tautscope.console.messages import decode_state
from tautscope.console.rig_control import RigControl
from tautscope.console.session import Session
from tautscope.console.shared import Channels, SharedMemory
from tautscope.console.start import web_server
from tautscope.log.reader import Log
from tautscope.loop.measurement import Tip
from tautscope.loop.rig import Frame, Rig, Sample

TIMEOUT, AGE = 1.5, 4.0
"""In place of `COMMAND_TIMEOUT` and `COMMAND_AGE` [s]."""


def small_config(**changes: Any) -> Config:
    """The default configuration with small JPEG images, which are drawn and encoded quickly."""
    return pages.sized("180x144").replace(**changes)


class Arm:
    """Axes without slack, whose drives are where they are told to be."""

    control_period = 0.005

    def __init__(self, count: int) -> None:
        self._start, self._ticks = np.zeros(count), 0
        self.picture: np.ndarray | None = None

    def reset(self) -> Sample:
        return self.step(self._start)

    def step(self, command: ArrayLike) -> Sample:
        self._ticks += 1
        now = self._ticks * self.control_period
        seen = () if self._ticks % 5 else (Tip(np.array(command), now),)
        frame = None if self.picture is None else Frame(self.picture, now, self._ticks)
        return Sample(now, np.array(command), frame, measurement=seen)

    def close(self) -> None: ...


class RunningConsole(pages.Address):
    """What tests need of a console: its address, and the state of the control loop itself."""

    def __init__(self, url: str, control: RigControl, server: Any) -> None:
        super().__init__(url)
        self.control = control
        self.server = server

    @property
    def command(self) -> np.ndarray:
        """The command c (3,) [m, rad, rad] that the twin's drives get."""
        assert self.control.run is not None
        return self.control.run.command.copy()

    def page(self, path: str = "/control", token: str | None = None) -> Page:
        return Page(self, path, token)


class Page(pages.Page):
    """A page's connection, with what only tests send."""

    def request(self, **message: Any) -> dict[str, Any]:
        """Send a request of the holder; its reply."""
        count = len(self.replies)
        self.send({**message, **self.fields()})
        self.wait(lambda: len(self.replies) > count)
        return self.replies[-1]

    def let_go(self) -> None:
        """Send that nothing is held, until the control process knows it."""

        def release() -> bool:
            self.servo((0.0,) * len(self.layout["dofs"]), is_holding=False)
            return not self.state["must_release"]

        self.wait(release, PERIOD)

    def move(self, axes: tuple[float, ...] | None = None) -> None:
        """Let go, then hold until the reference moves; by default insertion to its farther end."""
        self.let_go()
        if axes is None:
            is_far = self.state["reference"][0] > load_config().experiment.insertion.centre
            axes = (-1, 0, 0) if is_far else (1, 0, 0)
        self.hold(axes)


@contextmanager
def running_console(
    folder: Path, config: Config | None = None, rig: Rig | None = None
) -> Iterator[RunningConsole]:
    """A console of the twin, or of another rig, during the block."""
    config = small_config() if config is None else config
    ending = threading.Event()
    with (
        pytest.MonkeyPatch.context() as patch,
        web_server(config, 0) as (server, channels, url),
        ThreadPoolExecutor(1) as executor,
    ):
        patch.setattr(lease, "COMMAND_AGE", AGE)
        patch.setattr(operator_input, "COMMAND_TIMEOUT", TIMEOUT)
        patch.setattr(operator_input, "IDLE_TIMEOUT", TIMEOUT)
        control = RigControl(config, rig or LiveTwin(config), folder, executor)
        session = Session(control, channels, ending.is_set)
        thread = threading.Thread(target=session.main, name="control")
        thread.start()
        try:
            # Motors wait for the operator.
            while not control.is_hardware and (control.images.newest < 3 or not control.run):
                assert thread.is_alive()
                time.sleep(0.01)
            yield RunningConsole(url, control, server)
        finally:
            ending.set()
            thread.join()


@contextmanager
def player_of(log: Log) -> Iterator[tuple[LogPlayer, Channels]]:
    """A player of a log, and the channels of the page that it is shown on."""
    memory = SharedMemory(multiprocessing.get_context("spawn"), log.config)
    player = LogPlayer(log, Channels(memory))
    try:
        yield player, Channels(memory)
    finally:
        player.close()


def play_all(player: LogPlayer, shown: Channels) -> list[dict[str, Any]]:
    """Play to the end; the states that were shown."""
    states = []

    def look() -> bool:
        if (found := shown.state.newest()) is not None:
            states.append(decode_state(found[1]))
        return True

    player.run(look)
    return states


def rests(console: RunningConsole, duration: float = 0.3) -> bool:
    """Whether the command rests for a while [s], to the bit."""
    before = console.command
    time.sleep(duration)
    return bool((console.command == before).all())


def receive_image(video: Page) -> tuple[dict[str, Any], np.ndarray]:
    """The next image of a connection, with what is drawn over it."""
    message = video.socket.recv(timeout=20)
    assert isinstance(message, bytes)
    length = int.from_bytes(message[:4], "little")
    overlay = json.loads(message[4 : 4 + length])
    pixels = np.frombuffer(message[4 + length :], np.uint8)
    image = cv2.imdecode(pixels, cv2.IMREAD_COLOR)
    assert image is not None
    return overlay, image
