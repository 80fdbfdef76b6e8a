"""A console of the twin: web server in a process, control loop in a thread of the tests.

Its limits of time are longer than in use, because the computer may be busy.
`tests/console/test_operator_input.py` tests those in use, `benchmarks/console` measures them.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tautscope.config import Config, load_config
from tautscope.console import lease, operator_input
from tautscope.console.live_twin import LiveTwin
from tautscope.console.rig_control import RigControl
from tautscope.console.session import Session
from tautscope.console.start import web_server
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

TIMEOUT, AGE = 1.5, 4.0
"""In place of `COMMAND_TIMEOUT` and `COMMAND_AGE` [s]."""
SCALE = 0.25
"""Size of the images relative to PAL: they are drawn and encoded quickly."""


def small_config(**changes: Any) -> Config:
    """The default configuration with small JPEG images."""
    base = load_config()
    camera = base.camera
    return base.replace(
        **{
            "camera.width": round(SCALE * camera.width),
            "camera.height": round(SCALE * camera.height),
            "camera.fx": SCALE * camera.fx,
            "camera.fy": SCALE * camera.fy,
            "camera.cx": SCALE * camera.cx,
            "camera.cy": SCALE * camera.cy,
            "recording.image_format": "jpeg",
        },
        **changes,
    )


class RunningConsole:
    """What tests need of a console: its address, and the state of the control loop itself."""

    def __init__(self, url: str, control: RigControl, server: Any) -> None:
        self.url = url
        self.control = control
        self.server = server
        address, self.token = url.split("/#token=")
        self.host = address.removeprefix("http://")
        self.origin = address

    @property
    def command(self) -> np.ndarray:
        """The command c (3,) [m, rad, rad] that the twin's drives get."""
        assert self.control.run is not None
        return self.control.run.command.copy()

    def page(self, path: str = "/control", token: str | None = None) -> Page:
        return Page(self, path, self.token if token is None else token)


class Page:
    """A page's connection, without a browser."""

    def __init__(self, console: RunningConsole, path: str, token: str) -> None:
        self._resources = ExitStack()
        self.socket: ClientConnection = self._resources.enter_context(
            connect(
                f"ws://{console.host}{path}",
                origin=console.origin,
                compression=None,
                max_size=None,
                open_timeout=60,
            )
        )
        self.client = 0
        self.state: dict[str, Any] = {}
        self.replies: list[dict[str, Any]] = []
        self.sequence = 0
        self.is_closed = threading.Event()
        self.send({"type": "hello", "token": token})
        if path == "/control" and token == console.token:
            threading.Thread(target=self._read, daemon=True).start()

    def send(self, message: object) -> None:
        self.socket.send(json.dumps(message))

    def _read(self) -> None:
        """Receive messages until the connection ends."""
        with suppress(ConnectionClosed):
            while True:
                message = json.loads(self.socket.recv())
                if message["type"] == "welcome":
                    self.client = message["client"]
                elif message["type"] == "reply":
                    self.replies.append(message["reply"])
                else:
                    self.state = message["state"]
        self.is_closed.set()

    def wait(self, condition: Callable[[], object]) -> None:
        """Wait until a condition holds, which is evaluated as often as a page sends commands."""
        deadline = time.monotonic() + 30
        while not condition():
            assert time.monotonic() < deadline, (self.state, self.replies)
            time.sleep(0.02)

    def take(self) -> None:
        """Take the lease and wait until the state says so."""
        self.wait(lambda: bool(self.state and self.client))
        self.send({"type": "take"})
        self.wait(lambda: self.state["holder"] == self.client)

    def fields(self) -> dict[str, int]:
        self.sequence += 1
        image = self.state["image"]["sequence"]
        return {"lease": self.state["lease"], "sequence": self.sequence, "image": image}

    def servo(self, axes: tuple[float, ...] = (1, 0, 0), *, is_holding: bool = True) -> None:
        self.send({"type": "servo", **self.fields(), "axes": axes, "is_holding": is_holding})

    def request(self, **message: Any) -> dict[str, Any]:
        """Send a request of the holder; its reply."""
        count = len(self.replies)
        self.send({**message, **self.fields()})
        self.wait(lambda: len(self.replies) > count)
        return self.replies[-1]

    def let_go(self) -> None:
        """Send that nothing is held, until the control process knows it."""

        def release() -> bool:
            self.servo(is_holding=False)
            return not self.state["must_release"]

        self.wait(release)

    def move(self, axes: tuple[float, ...] | None = None) -> None:
        """Let go, then hold until the reference moves; by default insertion to its farther end."""
        self.let_go()
        if axes is None:
            is_far = self.state["reference"][0] > load_config().experiment.insertion.centre
            axes = (-1, 0, 0) if is_far else (1, 0, 0)

        def hold() -> bool:
            # On a busy computer a command may be late; then the operator presses again.
            self.servo(axes, is_holding=not self.state["must_release"])
            return bool(self.state["motion"] == "moving")

        self.wait(hold)

    def close(self) -> None:
        self._resources.close()


@contextmanager
def running_console(folder: Path, config: Config | None = None) -> Iterator[RunningConsole]:
    """A console of the twin during the block."""
    config = small_config() if config is None else config
    ending = threading.Event()
    with (
        pytest.MonkeyPatch.context() as patch,
        web_server(config.camera, 0) as (server, channels, url),
        ThreadPoolExecutor(1) as executor,
    ):
        patch.setattr(lease, "COMMAND_AGE", AGE)
        patch.setattr(operator_input, "COMMAND_TIMEOUT", TIMEOUT)
        control = RigControl(config, LiveTwin(config), folder, executor)
        session = Session(control, channels, ending.is_set)
        thread = threading.Thread(target=session.main, name="control")
        thread.start()
        try:
            while control.run is None or control.images.newest < 3:
                assert thread.is_alive()
                time.sleep(0.01)
            yield RunningConsole(url, control, server)
        finally:
            ending.set()
            thread.join()


def rests(console: RunningConsole, duration: float = 0.3) -> bool:
    """Whether the command rests for a while [s], to the bit."""
    before = console.command
    time.sleep(duration)
    return bool((console.command == before).all())
