"""The node as a process, in real time, with a node of ROS 2 written in Rust: tests/ros2/peer."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from common.paths import ROOT
from ros2.peers import free_endpoint
from tautscope.config import Config, dump_config, load_config
from tautscope.hardware.realtime import OTHERS, realtime
from tautscope.log.reader import read_log
from tautscope.loop.reduction import HysteresisReduction
from tautscope.ros2.session import Node
from tautscope.twin.rig import Twin

PEER = ROOT / "target" / "ros2-peer" / "release" / "peer"
"""Built by: cargo build --release --manifest-path tests/ros2/peer/Cargo.toml, see there."""
CENTRE, AMPLITUDE, PERIOD = (0.025, 0.0, 0.9), (0.004, 0.5, 0.25), 10.0
"""Motion of the peer [m, rad, rad], [s]."""
TIMEOUT = 30.0


def settings() -> Config:
    """The default configuration, with a log that fits on a disk."""
    return load_config().replace(**{"recording.image_format": "jpeg"})


def write_frames(config: Config, file: Path) -> None:
    """Images of the twin in the second period of the peer's motion, one after the other."""
    twin, loop = Twin(config), HysteresisReduction(config)
    sample = twin.reset()
    with file.open("wb") as out:
        while sample.time < 2 * PERIOD:
            wave = np.sin(2 * np.pi * sample.time / PERIOD)
            command = loop.step(np.array(CENTRE) + np.array(AMPLITUDE) * wave, sample.time)
            if (frame := sample.frame) is not None:
                loop.on_frame(frame)
                if frame.captured_at >= PERIOD:
                    out.write(frame.image.tobytes())
            sample = twin.step(command)
    twin.close()


class Lab:
    """The node, the peer, and a node that sends requests.

    Args:
        folder: For frames, logs and configuration.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._endpoint = free_endpoint()
        self.node = Node("benchmark", connect=self._endpoint)
        self._states = self.node.subscription(
            "/instrument/operating_state", "crtk_msgs/msg/OperatingState"
        )
        self._requests = self.node.publisher(
            "/instrument/state_command", "crtk_msgs/msg/StringStamped"
        )
        self._diagnostics = self.node.subscription(
            "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"
        )
        self._config = folder / "config.toml"
        self._config.write_text(dump_config(settings()), encoding="utf-8")
        frames = folder / "frames.bin"
        write_frames(settings(), frames)
        with realtime(OTHERS):  # where it is permitted: the peer measures
            self._peer = subprocess.Popen(
                [PEER, self._endpoint, "stream", frames],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        self._process: subprocess.Popen[str] | None = None
        self._runs = 0

    def start(self) -> None:
        """Start the node, and enable it."""
        self._runs += 1
        command = [sys.executable, "-m", "tautscope", "ros2", "--driver", "--json"]
        options = ["--config", self._config, "--listen", self._endpoint]
        self._process = subprocess.Popen(
            [*command, *options, "--out", self._folder / str(self._runs)],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdout is not None
        assert json.loads(self._process.stdout.readline()) == {"node": "/tautscope"}
        begin = time.monotonic()
        while self.state() != "ENABLED":
            assert time.monotonic() < begin + TIMEOUT, "the node cannot be enabled"
            self.request("enable")
            time.sleep(0.3)

    def state(self) -> str:
        """The newest operating state of the last 0.3 s."""
        self._states.take()
        time.sleep(0.15)
        message = self._states.take()
        return "" if message is None else str(message.state)

    def request(self, text: str) -> None:
        """Send a state command."""
        self._requests.publish({"string": text})

    def diagnostics(self) -> dict[str, str]:
        """The next diagnostics of the node."""
        self._diagnostics.take()
        while (message := self._diagnostics.take()) is None:
            time.sleep(0.01)
        return {each.key: each.value for each in message.status[0].values}

    def tell(self, word: str) -> None:
        """Send a word to the peer."""
        assert self._peer.stdin is not None
        self._peer.stdin.write(f"{word}\n")
        self._peer.stdin.flush()

    def event(self, name: str) -> dict[str, Any]:
        """The peer's next event of a name."""
        assert self._peer.stdout is not None
        while True:
            line = self._peer.stdout.readline()
            assert line, "the peer ended"
            found: dict[str, Any] = json.loads(line)
            if found["event"] == name:
                return found

    def kill(self) -> None:
        """SIGKILL to the node."""
        assert self._process is not None
        self._process.kill()
        self._process.communicate()

    def end(self) -> int:
        """SIGTERM to the node; its exit status."""
        assert self._process is not None
        self._process.send_signal(signal.SIGTERM)
        self._process.communicate()
        return self._process.returncode

    @property
    def log(self) -> Path:
        """The log of the present run."""
        return self._folder / str(self._runs) / "ros2-1.mcap"

    def close(self) -> None:
        """End all."""
        if self._process is not None and self._process.poll() is None:
            self.kill()
        self._peer.kill()
        self._peer.communicate()
        self.node.close()


@contextlib.contextmanager
def lab(folder: Path) -> Iterator[Lab]:
    """Node, peer and requests."""
    found = Lab(folder)
    try:
        yield found
    finally:
        found.close()


def round_trip(found: Lab, duration: float) -> dict[str, Any]:
    """References at 200 Hz and images at 25 Hz for a time [s]: losses and latencies."""
    topics = "/instrument/servo_jp", "/endoscope/image_raw"
    keys = [f"{what} {topic}" for topic in topics for what in ("received", "missed")]
    keys += ["ticks", "late ticks", "unused images"]
    before = found.diagnostics()
    found.tell("talk")
    time.sleep(duration)
    found.tell("report")
    report = found.event("report")
    found.tell("silent")
    found.event("silent")
    after = found.diagnostics()
    report["node"] = {key: int(after[key]) - int(before[key]) for key in keys}
    report["load"] = os.getloadavg()
    return report


def silences(found: Lab, count: int) -> list[float]:
    """The device falls silent: time from its last reference to the last moving set-point [s]."""
    times = []
    for _ in range(count):
        found.request("resume")
        time.sleep(0.3)
        found.tell("talk")
        time.sleep(1.0)
        found.tell("silent")
        times.append(float(found.event("silent")["after"]))
        assert found.state() == "PAUSED"
    return times


def kills(found: Lab, count: int) -> list[float]:
    """The node is killed: time from the last set-point to the driver's quick stop [s]."""
    times = []
    for _ in range(count):
        found.tell("talk")
        time.sleep(1.0)
        found.kill()
        times.append(float(found.event("quick stop")["after"]))
        found.tell("silent")
        found.event("silent")
        found.start()
    return times


def intervals(log: Path) -> dict[str, float]:
    """Quantiles of the time between two ticks [s], from the log of a run."""
    ticks = [each.sample.time for each in read_log(log).events.values() if hasattr(each, "sample")]
    steps = np.diff(ticks)[1:]  # the first has the opening of the log
    shares = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999, "max": 1.0}
    return {name: float(np.quantile(steps, share)) for name, share in shares.items()}


def build_peer(say: Callable[[str], None]) -> None:
    """Build the peer, which takes about ten minutes the first time."""
    if PEER.exists():
        return
    say("building tests/ros2/peer")
    manifest = ROOT / "tests" / "ros2" / "peer" / "Cargo.toml"
    environment = {**os.environ, "CARGO_TARGET_DIR": str(PEER.parents[1])}
    command = ["cargo", "build", "--release", "--locked", "--manifest-path", manifest]
    subprocess.run(command, env=environment, check=True)
