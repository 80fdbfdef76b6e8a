"""Consoles in processes of their own, and pages without a browser."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from tautscope.config import Config, dump_config, load_config
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

SIZES = {"720x576": (720, 576), "1920x1080": (1920, 1080)}
"""Sizes at which images are measured."""
PATIENCE = 60.0
PERIOD = 0.02
"""Time between two commands of a page [s]."""


def sized(name: str) -> Config:
    """The default configuration with images of another size."""
    base = load_config()
    camera = base.camera
    width, height = (int(side) for side in name.split("x"))
    across, down = width / camera.width, height / camera.height
    return base.replace(
        **{
            "camera.width": width,
            "camera.height": height,
            "camera.fx": camera.fx * across,
            "camera.fy": camera.fy * down,
            "camera.cx": camera.cx * across,
            "camera.cy": camera.cy * down,
            "recording.image_format": "jpeg",
        }
    )


class Address:
    """The parts of a console's address."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.origin, self.token = url.split("/#token=")
        self.host = self.origin.removeprefix("http://")


@contextmanager
def console(folder: Path, config: Config, *options: str) -> Iterator[tuple[Address, Any]]:
    """`tautscope console` in a process; its address, and the process."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "config.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    command = [sys.executable, "-m", "tautscope", "console", "--json", "--config", str(file)]
    with subprocess.Popen(
        [*command, *options, "--out", str(folder / "out")], stdout=subprocess.PIPE
    ) as process:
        try:
            assert process.stdout is not None
            yield Address(json.loads(process.stdout.readline())["url"]), process
        finally:
            process.terminate()


class Page:
    """A page's connection; with the console's token, a thread keeps its state up to date.

    Args:
        address: Of the console.
        path: ``/control`` for commands, or another route of the web server.
        token: By default that of the console.

    Attributes:
        client: The page's number; 0 before the console has accepted it.
        layout: What the console told it of the instrument.
        state: The newest state that was received.
        replies: To requests, in their order.
        is_closed: Set when the connection has ended.
        on_state: Called with each state.
        on_latency: Called with each latency.
    """

    def __init__(self, address: Address, path: str = "/control", token: str | None = None) -> None:
        self._resources = ExitStack()
        options: dict[str, Any] = {"origin": address.origin, "compression": None, "max_size": None}
        options["open_timeout"] = PATIENCE
        uri = f"ws://{address.host}{path}"
        self.socket = self._resources.enter_context(connect(uri, **options))
        self.client, self.state, self.layout = 0, dict[str, Any](), dict[str, Any]()
        self.replies = list[dict[str, Any]]()
        self.on_state: Callable[[dict[str, Any]], None] = lambda state: None
        self.on_latency: Callable[[Any], None] = lambda latency: None
        self.is_closed = threading.Event()
        self._sequence = 0
        token = address.token if token is None else token
        self.send({"type": "hello", "token": token})
        if path == "/control" and token == address.token:
            threading.Thread(target=self._read, daemon=True).start()
            self.wait(lambda: (self.state and self.client) or self.is_closed.is_set())

    def send(self, message: object) -> None:
        """Send a message as JSON."""
        self.socket.send(json.dumps(message))

    def wait(self, condition: Callable[[], object], period: float = 0.002) -> None:
        """Wait until a condition holds.

        Raises:
            TimeoutError: It does not.
        """
        deadline = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(str(self.state))
            time.sleep(period)

    def take(self) -> None:
        """Take the lease and wait until the state says so."""
        before = self.state["lease"]
        self.send({"type": "take"})
        self.wait(lambda: self.state["holder"] == self.client and self.state["lease"] != before)

    def fields(self, image: int | None = None) -> dict[str, int]:
        """The fields of a command, with the newest image if none is given."""
        self._sequence += 1
        newest = self.state["image"]["sequence"] if image is None else image
        return {"lease": self.state["lease"], "sequence": self._sequence, "image": newest}

    def servo(self, axes: tuple[float, ...] = (1, 0, 0), *, is_holding: bool = True) -> None:
        """Send a deflection."""
        axes = tuple(axis * is_holding for axis in axes)
        self.send({"type": "servo", **self.fields(), "axes": axes, "is_holding": is_holding})

    def action(self, name: str) -> None:
        """Send a request."""
        self.send({"type": "action", "name": name, **self.fields()})

    def ready(self) -> None:
        """Enable if stopped, and let go until the control process knows it."""
        if self.state["motion"] != "ready":
            self.action("enable")

        def released() -> bool:
            self.servo(is_holding=False)
            return not self.state["must_release"] and self.state["motion"] == "ready"

        self.wait(released, PERIOD)

    def hold(self, axes: tuple[float, ...] = (1, 0, 0)) -> None:
        """Hold until the instrument moves."""

        def moving() -> bool:
            # On a busy computer a command may be late; then the operator presses again.
            self.servo(axes, is_holding=not self.state["must_release"])
            return bool(self.state["motion"] == "moving")

        self.wait(moving, PERIOD)

    def close(self) -> None:
        """Close the connection."""
        self._resources.close()

    def _read(self) -> None:
        with suppress(ConnectionClosed):
            while True:
                message = json.loads(self.socket.recv())
                if message["type"] == "welcome":
                    self.client, self.layout = message["client"], message["layout"]
                elif message["type"] == "reply":
                    self.replies.append(message["reply"])
                else:
                    if message["latency"]:
                        self.on_latency(tuple(message["latency"]))
                    self.state = message["state"]
                    self.on_state(self.state)
        self.is_closed.set()
