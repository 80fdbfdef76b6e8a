"""A node of ROS 2 in a Zenoh session, and its clocks."""

import json
import re
import time
from ipaddress import ip_address
from typing import Self

import zenoh

from tautscope.errors import ConfigError
from tautscope.ros2 import types, wire
from tautscope.ros2.endpoints import Handler, Publisher, Service, Subscription
from tautscope.ros2.wire import HUMBLE, JAZZY, NO_HASH, Entity, Qos

ROUTER = "tcp/127.0.0.1:7447"
"""Where the router of rmw_zenoh, `ros2 run rmw_zenoh_cpp rmw_zenohd`, listens."""
SENSOR_DATA = Qos(depth=1, is_reliable=False)
"""Best effort, and only the newest: images."""
NEWEST = Qos(depth=1)
"""Only the newest: set-points."""
_RELIABILITY = {True: zenoh.Reliability.RELIABLE, False: zenoh.Reliability.BEST_EFFORT}
_PRIORITY = {True: zenoh.Priority.REAL_TIME, False: zenoh.Priority.DATA}
_QUEUE = 16
"""Batches that wait for the transport, per priority; Zenoh allows no more."""
_LARGEST_DOMAIN = 232
_LOOPBACK = "tcp/127.0.0.1:0"
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")


class Clock:
    """The clocks of a node [ns]: monotonic for control, wall clock for stamps."""

    def monotonic(self) -> int:
        """The monotonic clock [ns]; it is never set."""
        return time.monotonic_ns()

    def wall(self) -> int:
        """The wall clock [ns since 1970], which stamps are of."""
        return time.time_ns()

    def sleep_until(self, instant: int) -> None:
        """Wait until a time of the monotonic clock [ns]."""
        time.sleep(max(0.0, (instant - time.monotonic_ns()) / 1e9))


class Node:
    """A node of ROS 2; a context manager.

    It listens on 127.0.0.1 alone, and connects to a router or to another node.

    Args:
        name: Name of the node.
        namespace: Empty, or ``/name``.
        domain: ROS_DOMAIN_ID.
        distribution: Of the nodes that it talks with, `HUMBLE` or `JAZZY`.
        connect: Endpoint of a router or another node; tried again until it answers. Empty: none.
        listen: Own endpoint, on the loopback interface.
        is_blocking: Whether a publisher waits while the transport is busy, and drops no message;
            for comparisons.

    Raises:
        ConfigError: A name, the domain or an endpoint is not valid, or not free.
    """

    def __init__(
        self,
        name: str,
        namespace: str = "",
        *,
        domain: int = 0,
        distribution: str = JAZZY,
        connect: str = ROUTER,
        listen: str = _LOOPBACK,
        is_blocking: bool = False,
    ) -> None:
        if not _NAME.fullmatch(namespace):
            raise ConfigError("namespace", namespace, "empty, or names that begin with a slash")
        if not 0 <= domain <= _LARGEST_DOMAIN:
            raise ConfigError("domain", domain, f"0 to {_LARGEST_DOMAIN}")
        check_loopback(listen)
        settings = {
            "mode": "peer",
            "connect/endpoints": [connect] if connect else [],
            # As a node of ROS: it may start before the router, and go on after its restart.
            "connect/exit_on_failure": False,
            "connect/timeout_ms": -1,
            "listen/endpoints": [listen],
            "scouting/multicast/enabled": False,
            # The default of 1 drops the second message of a tick if the computer is busy for 1 ms.
            "transport/link/tx/queue/size/real_time": _QUEUE,
            "transport/link/tx/queue/size/data": _QUEUE,
        }
        config = zenoh.Config()
        try:
            for setting, value in settings.items():
                config.insert_json5(setting, json.dumps(value))
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            endpoints = f"connect {connect}, listen {listen}"
            raise ConfigError("endpoint", endpoints, f"as tcp/127.0.0.1:7447 ({error})") from None
        self.identity = wire.Identity(domain, str(self._session.info.zid()), namespace, name)
        self._tokens = [self._session.liveliness().declare_token(self.identity.node_token())]
        self._congestion = (
            zenoh.CongestionControl.BLOCK if is_blocking else zenoh.CongestionControl.DROP
        )
        self._has_hashes = distribution != HUMBLE
        self.subscriptions: list[Subscription] = []
        self._services: list[Service] = []

    def publisher(self, topic: str, kind: str, qos: Qos = NEWEST) -> Publisher:
        """A publisher of messages of a type."""
        key, token = self._announce(Entity.PUBLISHER, topic, kind, qos)
        # An image fills the queue of its priority: set-points must not be dropped behind it.
        publisher = self._session.declare_publisher(
            key,
            reliability=_RELIABILITY[qos.is_reliable],
            priority=_PRIORITY[qos.is_reliable],
            congestion_control=self._congestion,
            express=True,
        )
        return Publisher(kind, publisher, wire.gid(token))

    def subscription(self, topic: str, kind: str, qos: Qos = NEWEST) -> Subscription:
        """A subscription that keeps the newest `qos.depth` messages."""
        key, _ = self._announce(Entity.SUBSCRIPTION, topic, kind, qos)
        channel: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(qos.depth)
        subscriber = self._session.declare_subscriber(key, channel)
        subscription = Subscription(self.resolve(topic), kind, subscriber)
        self.subscriptions.append(subscription)
        return subscription

    def add_service(self, name: str, kind: str, handler: Handler) -> None:
        """Offer a service; `handler` makes the fields of the response to a request."""
        key, _ = self._announce(Entity.SERVICE, name, kind, Qos())
        channel: zenoh.handlers.FifoChannel[zenoh.Query] = zenoh.handlers.FifoChannel(16)
        queryable = self._session.declare_queryable(key, channel, complete=True)
        self._services.append(Service(kind, queryable, handler))

    def serve(self) -> None:
        """Answer the requests that wait at the services."""
        for service in self._services:
            service.serve()

    def resolve(self, topic: str) -> str:
        """The full name of a topic: ``~/name`` is below the node, ``name`` below the namespace."""
        if topic.startswith("~/"):
            return f"{self.identity.path}{topic[1:]}"
        return topic if topic.startswith("/") else f"{self.identity.namespace}/{topic}"

    def close(self) -> None:
        """Leave the network; the process cannot end before."""
        self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _announce(self, entity: Entity, topic: str, kind: str, qos: Qos) -> tuple[str, str]:
        """Key of a topic or service, and the token by which it is visible."""
        topic, rihs = self.resolve(topic), types.type_hash(kind) if self._has_hashes else NO_HASH
        token = self.identity.token(len(self._tokens), entity, topic, kind=kind, rihs=rihs, qos=qos)
        self._tokens.append(self._session.liveliness().declare_token(token))
        return wire.key(self.identity.domain, topic, kind, rihs), token


def check_loopback(endpoint: str) -> None:
    """Refuse an endpoint to which others than this computer connect, with a `ConfigError`."""
    host = endpoint.partition("/")[2].rpartition(":")[0].strip("[]")
    try:
        is_loopback = host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        is_loopback = False
    if not is_loopback or not endpoint.startswith("tcp/"):
        allowed = (
            "an endpoint on this computer, as tcp/127.0.0.1:7447: who connects can move motors"
        )
        raise ConfigError("listen", endpoint, allowed)
