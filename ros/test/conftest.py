"""A recording, and an operator, an endoscope and drives that replay it."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import rclpy
from crtk_msgs.msg import OperatingState, StringStamped
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

ROOT = Path(__file__).resolve().parents[2]
JOINTS = ["insertion", "rotation", "bending"]


@dataclass(frozen=True)
class Recorded:
    """References and images of `examples/cpp/record.py`.

    Attributes:
        config: File of the configuration.
        ticks: Times, when made, references (3,), events, commands (3,).
        images: Ticks, capture times and what was estimated.
        pixels: (n, 576, 720, 3).
    """

    config: Path
    ticks: NDArray[np.float64]
    images: NDArray[np.float64]
    pixels: NDArray[np.uint8]


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    folder = tmp_path_factory.mktemp("recordings")
    sys.path.insert(0, str(ROOT / "examples" / "cpp"))
    import record

    record.record_frames(folder).write(folder, "frames")
    return Recorded(
        folder / "frames.toml",
        np.fromfile(folder / "frames.ticks").reshape(-1, 9),
        np.fromfile(folder / "frames.images").reshape(-1, 23),
        np.fromfile(folder / "frames.pixels", np.uint8).reshape(-1, 576, 720, 3),
    )


class Laboratory(Node):
    """Operator, endoscope and drives around a node of this repository.

    Args:
        namespace: Of the instrument's topics.
        commands: Topic on which the drives get their set-points.
    """

    def __init__(self, namespace: str, commands: str) -> None:
        super().__init__("laboratory")
        self.commands: list[JointState] = []
        self.measured: list[JointState] = []
        self.states: list[str] = []
        self.warnings: list[str] = []
        self.drive_commands: list[str] = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        reliable = QoSProfile(depth=1000)
        self.references = self.create_publisher(JointState, f"{namespace}/servo_jp", 1)
        self.requests = self.create_publisher(StringStamped, f"{namespace}/state_command", 10)
        self.drive_states = self.create_publisher(
            OperatingState, f"{namespace}/actuators/operating_state", 1
        )
        self.drives = self.create_publisher(JointState, f"{namespace}/actuators/measured_js", 1)
        self.images = self.create_publisher(Image, "/endoscope/image_raw", qos_profile_sensor_data)
        self._listen(JointState, commands, self.commands.append, reliable)
        self._listen(JointState, f"{namespace}/measured_js", self.measured.append, reliable)
        self._listen(
            OperatingState,
            f"{namespace}/operating_state",
            lambda message: self.states.append(message.state),
            latched,
        )
        self._listen(
            String,
            f"{namespace}/warning",
            lambda message: self.warnings.append(message.data),
            latched,
        )
        self._listen(
            StringStamped,
            f"{namespace}/actuators/state_command",
            lambda message: self.drive_commands.append(message.string),
            reliable,
        )
        self.position: list[float] = []
        self._listen(JointState, commands, self._move, reliable)
        self.create_timer(0.01, self._measure)
        self.executor_of_tests = SingleThreadedExecutor()
        self.executor_of_tests.add_node(self)

    def _listen(self, kind: type, topic: str, callback: Callable, qos: QoSProfile) -> None:
        self.create_subscription(kind, topic, callback, qos)

    def spin(self, duration: float) -> None:
        """Receive for a time [s]."""
        end = time.monotonic() + duration
        while (left := end - time.monotonic()) > 0:
            self.executor_of_tests.spin_once(timeout_sec=left)

    def wait_for(self, condition: Callable[[], bool], timeout: float = 10.0) -> None:
        """Receive until a condition holds."""
        end = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < end, f"states {self.states}, warnings {self.warnings}"
            self.executor_of_tests.spin_once(timeout_sec=0.05)

    def request(self, text: str) -> None:
        """Publish a state command, once the node listens."""
        self.wait_for(lambda: self.requests.get_subscription_count() > 0)
        self.requests.publish(StringStamped(string=text))

    def measure(self, position: NDArray[np.float64]) -> None:
        """Publish from now on where the drives are: here (3,), then where they are commanded."""
        self.wait_for(lambda: self.drives.get_subscription_count() > 0)
        self.position = list(position)
        self.spin(0.2)

    def _move(self, command: JointState) -> None:
        if self.position:
            self.position = list(command.position)

    def _measure(self) -> None:
        if self.position:
            message = JointState(name=JOINTS, position=self.position)
            message.header.stamp = self.get_clock().now().to_msg()
            self.drives.publish(message)

    def refer(self, position: NDArray[np.float64]) -> int:
        """Publish a reference (3,); its stamp [ns]."""
        now = self.get_clock().now()
        message = JointState(name=JOINTS, position=position.tolist())
        message.header.stamp = now.to_msg()
        self.references.publish(message)
        return now.nanoseconds

    def show(self, pixels: NDArray[np.uint8], captured_at: int) -> None:
        """Publish an image with its capture time [ns]."""
        height, width = pixels.shape[:2]
        message = Image(height=height, width=width, encoding="bgr8", step=3 * width)
        message.data = pixels.tobytes()
        message.header.stamp = Time(nanoseconds=captured_at).to_msg()
        self.images.publish(message)

    def replay(self, recorded: Recorded, *, with_images: bool = True) -> tuple[int, list[int]]:
        """The recording at its own pace; stamps [ns] of the last reference and of the images."""
        start, begin = self.get_clock().now().nanoseconds, time.monotonic()
        image, last, shown = 0, 0, []
        for tick in recorded.ticks:
            self.spin(max(0.0, begin + tick[0] - time.monotonic()))
            last = self.refer(tick[2:5])
            # As a camera: two ticks after the capture.
            while (
                with_images
                and image < len(recorded.images)
                and recorded.images[image][1] + 0.01 <= tick[0]
            ):
                shown.append(start + round(1e9 * recorded.images[image][1]))
                self.show(recorded.pixels[image], shown[-1])
                image += 1
        return last, shown


def stamp(message: JointState) -> int:
    """Stamp of a message [ns]."""
    return Time.from_msg(message.header.stamp).nanoseconds


def last_motion(messages: list[JointState]) -> int:
    """Stamp of the last message whose positions differ from those before [ns]."""
    moved = [
        stamp(after) for before, after in pairwise(messages) if before.position != after.position
    ]
    return moved[-1] if moved else 0


@pytest.fixture
def ros() -> Iterator[None]:
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture
def processes() -> Iterator[list[subprocess.Popen]]:
    """Processes that end with the test."""
    started: list[subprocess.Popen] = []
    yield started
    for process in started:
        process.terminate()
    for process in started:
        process.wait(10)
