"""Test doubles of rclpy and of message packages: as much of them as the node uses.

`ros/test` runs the node with the real ones.
"""

import sys
from collections import defaultdict
from types import ModuleType, SimpleNamespace
from typing import Any


class Message:
    """A message with any fields; header, stamp and layout exist."""

    OK, WARN, ERROR = b"\0", b"\1", b"\2"

    def __init__(self, **fields: Any) -> None:
        self.header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0), frame_id="")
        self.layout = SimpleNamespace(dim=[])
        vars(self).update(fields)


class Time:
    """A time in ns."""

    def __init__(self, *, nanoseconds: int = 0) -> None:
        if nanoseconds < 0:
            raise ValueError("Nanoseconds value must not be negative")
        self.nanoseconds = nanoseconds

    def to_msg(self) -> SimpleNamespace:
        return SimpleNamespace(sec=self.nanoseconds // 10**9, nanosec=self.nanoseconds % 10**9)


class Node:
    """A lifecycle node without a middleware.

    Attributes:
        published: Messages by topic.
        callbacks: Callbacks of the subscriptions by topic.
        qos: Quality of service by topic.
        timers: Period [s] and callback of each timer.
        now: The clock [ns].
    """

    overrides: dict[str, Any] = {}  # noqa: RUF012

    def __init__(self, name: str) -> None:
        self.published: dict[str, list[Any]] = defaultdict(list)
        self.callbacks: dict[str, Any] = {}
        self.qos: dict[str, Any] = {}
        self.groups: dict[str, Any] = {}
        self.timers: list[tuple[float, Any]] = []
        self.logged: list[str] = []
        self.now = 1_700_000_000 * 10**9
        self._parameters: dict[str, Any] = {}
        self._check: Any = None

    def declare_parameter(self, name: str, value: Any) -> None:
        self._parameters[name] = self.overrides.get(name, value)

    def get_parameter(self, name: str) -> SimpleNamespace:
        return SimpleNamespace(value=self._parameters[name])

    def add_on_set_parameters_callback(self, callback: Any) -> None:
        self._check = callback

    def set_parameter(self, name: str, value: Any) -> Any:
        return self._check([SimpleNamespace(name=name, value=value)])

    def get_fully_qualified_name(self) -> str:
        return "/instrument/tautscope"

    def get_logger(self) -> SimpleNamespace:
        def log(text: str, **_: Any) -> None:
            self.logged.append(text)

        return SimpleNamespace(error=log, warning=log, info=log)

    def get_clock(self) -> SimpleNamespace:
        return SimpleNamespace(now=lambda: Time(nanoseconds=self.now))

    def create_publisher(self, kind: Any, topic: str, qos: Any) -> SimpleNamespace:
        self.qos[topic] = qos
        return SimpleNamespace(publish=self.published[topic].append)

    def create_subscription(
        self, kind: Any, topic: str, callback: Any, qos: Any, *, callback_group: Any = None
    ) -> str:
        self.qos[topic], self.callbacks[topic] = qos, callback
        self.groups[topic] = callback_group
        return topic

    def create_timer(self, period: float, callback: Any) -> tuple[float, Any]:
        self.timers.append((period, callback))
        return self.timers[-1]

    def destroy_timer(self, timer: Any) -> None:
        self.timers.remove(timer)

    def destroy_subscription(self, topic: str) -> None:
        del self.callbacks[topic]

    def destroy_publisher(self, publisher: Any) -> None:
        pass


def _module(name: str, **members: Any) -> ModuleType:
    module = ModuleType(name)
    vars(module).update(members)
    return module


def modules() -> dict[str, ModuleType]:
    """The modules that the node imports."""
    policy = SimpleNamespace(KEEP_LAST=1, BEST_EFFORT="best effort", TRANSIENT_LOCAL="latched")
    results = SimpleNamespace(SUCCESS="success", FAILURE="failure")
    messages = {
        "crtk_msgs": ("OperatingState", "StringStamped"),
        "diagnostic_msgs": ("DiagnosticArray", "DiagnosticStatus", "KeyValue"),
        "geometry_msgs": ("PointStamped", "PoseStamped", "PoseWithCovarianceStamped"),
        "rcl_interfaces": ("SetParametersResult",),
        "sensor_msgs": ("CameraInfo", "Image", "JointState"),
        "std_msgs": ("Float64MultiArray", "MultiArrayDimension", "String"),
    }
    found = [
        _module("rclpy"),
        _module("rclpy.callback_groups", MutuallyExclusiveCallbackGroup=object),
        _module("rclpy.executors", MultiThreadedExecutor=object),
        _module(
            "rclpy.lifecycle",
            LifecycleNode=Node,
            LifecycleState=object,
            TransitionCallbackReturn=results,
        ),
        _module("rclpy.parameter", Parameter=object),
        _module(
            "rclpy.qos",
            DurabilityPolicy=policy,
            HistoryPolicy=policy,
            ReliabilityPolicy=policy,
            QoSProfile=SimpleNamespace,
        ),
        _module("rclpy.signals", SignalHandlerOptions=object),
        _module("rclpy.time", Time=Time),
    ]
    for package, names in messages.items():
        kinds = {name: type(name, (Message,), {}) for name in names}
        found += [_module(package), _module(f"{package}.msg", **kinds)]
    return {module.__name__: module for module in found}


def install() -> None:
    """Make the doubles importable, where the packages themselves are not installed."""
    for name, module in modules().items():
        sys.modules.setdefault(name, module)
