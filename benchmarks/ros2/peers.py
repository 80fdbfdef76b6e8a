"""A node under test on a stepped clock, and another node that sends and receives its messages.

Messages go over Zenoh, in a session for each node.
"""

import contextlib
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.ros2 import messages
from tautscope.ros2.control import MakeRig, NodeControl
from tautscope.ros2.endpoints import IMAGE, Subscription
from tautscope.ros2.inputs import JoyAxes
from tautscope.ros2.session import SENSOR_DATA, Clock, Node
from tautscope.ros2.wire import Qos

Floats = NDArray[np.float64]
JOINTS, NUMBER = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64"
EPOCH = 1_700_000_000_000_000_000
"""Wall clock time of the start [ns]."""
TIMEOUT = 60.0
SETTLING = 0.1
"""Time in which a message arrives that another topic's has overtaken [s]."""


class SteppedClock(Clock):
    """A clock that goes on when the node waits; `before_tick` is called then, with the time."""

    def __init__(self) -> None:
        self.now = 10**9
        self.before_tick: Callable[[], None] = lambda: None

    def monotonic(self) -> int:  # noqa: D102  as Clock
        return self.now

    def wall(self) -> int:  # noqa: D102
        return EPOCH + self.now

    def sleep_until(self, instant: int) -> None:  # noqa: D102
        self.now = max(self.now, instant)
        self.before_tick()


class InlineExecutor(Executor):
    """Runs at once what is submitted."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The result of a call, as a future."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


BARRIER = "/barrier"
"""Beginning of the names of the barriers' topics."""


def free_endpoint() -> str:
    """A free port of this computer, as an endpoint."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


class Barrier:
    """A topic whose messages arrive after all that was published before with the same priority."""

    def __init__(self, sender: Node, receiver: Node, kind: int) -> None:
        topic = f"{BARRIER}{kind}"
        # Deep enough that none which is sent again replaces another: that would count as missed.
        self._in = receiver.subscription(topic, NUMBER, Qos(depth=1000))
        self._out = sender.publisher(topic, NUMBER, Qos(is_reliable=kind == 0))
        self._sent = 0

    def wait(self, *, resend: bool = False) -> None:
        """Wait until it has arrived; `resend`: send until the sessions are connected."""
        self._sent += 1
        number = {"data": float(self._sent)}
        begin = sent = time.monotonic()
        self._out.publish(number)
        while (found := self._in.take()) is None or found.data != self._sent:
            now = time.monotonic()
            assert now < begin + TIMEOUT, "nothing arrives"
            if now > sent + (0.02 if resend else 1.0):
                sent = now
                self._out.publish(number)


class Peers:
    """A node under test on a stepped clock, and another node that talks with it.

    Attributes:
        endpoint: Where the node under test listens.
        clock: The clock of the node under test.
        control: The node under test.
        other: The other node, in a session of its own.
    """

    def __init__(
        self,
        config: Config,
        folder: Path,
        *,
        make_rig: MakeRig | None = None,
        device: str = "servo_jp",
    ) -> None:
        self.endpoint = free_endpoint()
        self.clock = SteppedClock()
        self.config, self.joints = config, [dof.label for dof in config.dofs]
        # A busy computer must not drop what is compared.
        self.node = Node("tautscope", connect="", listen=self.endpoint, is_blocking=True)
        self.other = Node("other", connect=self.endpoint, is_blocking=True)
        self.control = NodeControl(
            config, self.node, folder, InlineExecutor(), self.clock,
            make_rig=make_rig, device=device, layout=JoyAxes(),
        )  # fmt: skip
        # One per priority, because order is kept within each.
        self._barriers_to_node = [Barrier(self.other, self.node, n) for n in range(2)]
        self.servo = self.other.publisher("/instrument/servo_jp", JOINTS)
        self.positions = self.other.publisher("/instrument/actuators/measured_js", JOINTS)
        self.images = self.other.publisher("/endoscope/image_raw", IMAGE, SENSOR_DATA)
        self.requests = self.other.publisher(
            "/instrument/state_command", "crtk_msgs/msg/StringStamped"
        )
        self.commands = self.other.subscription(
            "/instrument/actuators/setpoint_js", JOINTS, Qos(depth=1000)
        )
        self.warnings = self.other.subscription(
            "/instrument/warning", "std_msgs/msg/String", Qos(depth=1000)
        )
        self.states = self.other.subscription(
            "/instrument/operating_state", "crtk_msgs/msg/OperatingState", Qos(depth=1000)
        )
        self._barrier_to_other = Barrier(self.node, self.other, 0)
        self.delivered(resend=True)
        self._barrier_to_other.wait(resend=True)

    def close(self) -> None:
        """End both nodes."""
        self.control.shut_down()
        self.other.close()
        self.node.close()

    def delivered(self, *, resend: bool = False) -> None:
        """Wait until everything that was published has arrived: a session keeps the order."""
        for barrier in self._barriers_to_node:
            barrier.wait(resend=resend)

    def received(self, subscription: Subscription, what: str) -> Any:
        """The next message of the other node's subscription."""
        begin = time.monotonic()
        while (found := subscription.take()) is None:
            assert time.monotonic() < begin + TIMEOUT, f"no {what}"
        return found

    def request(self, text: str) -> None:
        """Send a state command, and let the node execute it."""
        self.requests.publish({"string": text})
        self.delivered()
        self.control.serve()

    def send_position(self, values: Floats) -> None:
        """Send the drives' positions (n,) [m or rad]."""
        self.positions.publish(messages.joint_state(self.clock.wall(), self.joints, values))

    def send_reference(self, values: Floats) -> None:
        """Send a reference (n,) [m or rad]."""
        self.servo.publish(messages.joint_state(self.clock.wall(), self.joints, values))

    def enable(self, at: Floats) -> None:
        """Enable the loop with the drives at a position (n,)."""
        with self.at_rest(at):
            self.request("enable")
        assert self.control.run is not None, self.control.fault

    @contextlib.contextmanager
    def at_rest(self, at: Floats) -> Iterator[None]:
        """Send the drives' position (n,) whenever the node waits."""

        def send() -> None:
            self.send_position(at)
            self.delivered()

        before, self.clock.before_tick = self.clock.before_tick, send
        try:
            yield
        finally:
            self.clock.before_tick = before

    def tick(self) -> None:
        """A tick of the node under test."""
        assert self.control.run is not None, self.control.fault
        self.control.serve()
        self.control.tick(self.control.run)

    def drain(self, subscription: Subscription) -> list[Any]:
        """What the node has published until now, as it arrived at the other node."""
        self._barrier_to_other.wait()
        time.sleep(SETTLING)  # topics may overtake each other
        found = []
        while (message := subscription.take()) is not None:
            found.append(message)
        return found


@contextlib.contextmanager
def peers(config: Config, folder: Path, **options: Any) -> Iterator[Peers]:
    """A node under test and another one."""
    both = Peers(config, folder, **options)
    try:
        yield both
    finally:
        both.close()
