"""A node's publishers, subscriptions and services in a Zenoh session.

Nothing here calls back: messages wait in channels of Zenoh, outside Python, until they are taken.
A control loop that takes them is never interrupted by one.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from ipaddress import ip_address
from typing import Any

import zenoh

from tautscope.errors import ConfigError, MessageError
from tautscope.ros2 import types, wire
from tautscope.ros2.wire import Entity, Qos

IMAGE = "sensor_msgs/msg/Image"
ROUTER = "tcp/127.0.0.1:7447"
"""Where the router of rmw_zenoh, `ros2 run rmw_zenoh_cpp rmw_zenohd`, listens."""
SENSOR_DATA = Qos(depth=1, is_reliable=False)
"""Best effort, and only the newest: images."""
NEWEST = Qos(depth=1)
"""Only the newest: set-points."""
LARGEST = 2**16
"""Longest message that is decoded, but for images [byte]: a tick must not wait for a longer one."""
LARGEST_IMAGE = 2**26
"""Longest image that is decoded [byte]."""
_RELIABILITY = {True: zenoh.Reliability.RELIABLE, False: zenoh.Reliability.BEST_EFFORT}
_PRIORITY = {True: zenoh.Priority.REAL_TIME, False: zenoh.Priority.DATA}
_QUEUE = 16
"""Batches that wait for the transport, per priority; Zenoh allows no more."""
_LARGEST_DOMAIN = 232
_LOOPBACK = "tcp/127.0.0.1:0"
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)*")


class Publisher:
    """Publishes messages of one topic; made by `Node.publisher`."""

    def __init__(self, publisher: Any, token: Any, source: bytes) -> None:
        self._publisher, self._token, self._source = publisher, token, source
        self._sequence = 0

    def publish(self, message: Any) -> None:
        """Send a message; what the transport cannot take in 1 ms, images in 50 ms, is dropped."""
        self.send(types.encode(message))

    def send(self, payload: bytes) -> None:
        """Send a message that is encoded already."""
        self._sequence += 1
        attachment = wire.attachment(self._sequence, time.time_ns(), self._source)
        self._publisher.put(payload, attachment=attachment)

    @property
    def has_subscribers(self) -> bool:
        """Whether anybody receives the topic."""
        return bool(self._publisher.matching_status.matching)


class Subscription:
    """The messages of one topic; made by `Node.subscription`.

    Attributes:
        topic: Full name of the topic.
        received: Number of messages taken.
        missed: Number of messages between these that were lost, or replaced by newer ones.
        source: Identifier of the publisher of the last message; empty if it has none.
    """

    def __init__(self, topic: str, kind: str, subscriber: Any, token: Any) -> None:
        self.topic, self._kind = topic, kind
        self._largest = LARGEST_IMAGE if kind == IMAGE else LARGEST
        self._subscriber, self._token = subscriber, token
        self.received = self.missed = 0
        self.source = b""
        self._sequence = 0

    def take(self) -> Any | None:
        """The oldest message that waits, or None.

        Raises:
            MessageError: It cannot be decoded.
        """
        sample = self._subscriber.try_recv()
        if sample is None:
            return None
        self.received += 1
        before, self.source = self.source, b""
        try:
            if sample.attachment is not None:
                attachment = _payload(sample.attachment, LARGEST)
                sequence, _, self.source = wire.read_attachment(attachment)
                if self.source == before:
                    self.missed += max(sequence - self._sequence - 1, 0)
                self._sequence = sequence
            return types.decode(self._kind, _payload(sample.payload, self._largest))
        except MessageError as error:
            raise MessageError(self.topic, error.value, error.allowed) from None


class Service:
    """Requests to a service; made by `Node.service`."""

    def __init__(
        self, kind: str, queryable: Any, token: Any, handler: Callable[[Any], Any]
    ) -> None:
        self._kind, self._queryable, self._token = kind, queryable, token
        self._handler = handler

    def serve(self) -> None:
        """Answer the requests that wait; one that cannot be decoded gets an error."""
        while (query := self._queryable.try_recv()) is not None:
            with query:
                self._answer(query)

    def _answer(self, query: Any) -> None:
        try:
            if query.payload is None or query.attachment is None:
                raise MessageError(self._kind, None, "a request with an attachment")
            sequence, _, source = wire.read_attachment(_payload(query.attachment, LARGEST))
            request = types.decode(f"{self._kind}_Request", _payload(query.payload, LARGEST))
            response = types.encode(self._handler(request))
        except MessageError as error:
            query.reply_err(str(error).encode())
            return
        attachment = wire.attachment(sequence, time.time_ns(), source)
        query.reply(query.key_expr, response, attachment=attachment)


class Node:
    """A node of ROS 2; a context manager.

    It listens on 127.0.0.1 alone, and connects to a router or to another node.

    Args:
        name: Name of the node.
        namespace: Empty, or ``/name``.
        domain: ROS_DOMAIN_ID.
        connect: Endpoint of a router or another node; tried again until it answers. Empty: none.
        listen: Own endpoint, on the loopback interface.

    Attributes:
        identity: The node in the network.
        subscriptions: All subscriptions.

    Raises:
        ConfigError: A name, the domain or an endpoint is not valid, or not free.
    """

    def __init__(
        self,
        name: str,
        namespace: str = "",
        *,
        domain: int = 0,
        connect: str = ROUTER,
        listen: str = _LOOPBACK,
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
        self._tokens = [self._declare(self.identity.node_token())]
        self._entities = 0
        self.subscriptions: list[Subscription] = []

    def publisher(self, topic: str, kind: str, qos: Qos = NEWEST) -> Publisher:
        """A publisher of messages of a type."""
        token, name = self._announce(Entity.PUBLISHER, topic, kind, qos)
        # An image fills the queue of its priority: set-points must not be dropped behind it.
        publisher = self._session.declare_publisher(
            self._key(topic, kind),
            reliability=_RELIABILITY[qos.is_reliable],
            priority=_PRIORITY[qos.is_reliable],
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
        )
        return Publisher(publisher, token, wire.gid(name))

    def subscription(self, topic: str, kind: str, qos: Qos = NEWEST) -> Subscription:
        """A subscription that keeps the newest `qos.depth` messages."""
        token, _ = self._announce(Entity.SUBSCRIPTION, topic, kind, qos)
        channel: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(qos.depth)
        subscriber = self._session.declare_subscriber(self._key(topic, kind), channel)
        subscription = Subscription(self.resolve(topic), kind, subscriber, token)
        self.subscriptions.append(subscription)
        return subscription

    def service(self, name: str, kind: str, handler: Callable[[Any], Any]) -> Service:
        """A service; `handler` makes the response to a request."""
        token, _ = self._announce(Entity.SERVICE, name, kind, Qos())
        channel: zenoh.handlers.FifoChannel[zenoh.Query] = zenoh.handlers.FifoChannel(16)
        queryable = self._session.declare_queryable(self._key(name, kind), channel, complete=True)
        return Service(kind, queryable, token, handler)

    def resolve(self, topic: str) -> str:
        """The full name of a topic: ``~/name`` is below the node, ``name`` below the namespace."""
        if topic.startswith("~/"):
            return f"{self.identity.path}{topic[1:]}"
        return topic if topic.startswith("/") else f"{self.identity.namespace}/{topic}"

    def close(self) -> None:
        """Leave the network; the process cannot end before."""
        self._session.close()  # type: ignore[no-untyped-call]

    def __enter__(self) -> Node:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _key(self, topic: str, kind: str) -> str:
        return wire.key(self.identity.domain, self.resolve(topic), kind, types.type_hash(kind))

    def _announce(self, entity: Entity, topic: str, kind: str, qos: Qos) -> tuple[Any, str]:
        self._entities += 1
        name = self.identity.token(
            self._entities,
            entity,
            self.resolve(topic),
            kind=kind,
            rihs=types.type_hash(kind),
            qos=qos,
        )
        return self._declare(name), name

    def _declare(self, token: str) -> Any:
        return self._session.liveliness().declare_token(token)


def _payload(data: Any, largest: int) -> bytes:
    if len(data) > largest:
        raise MessageError("message", f"{len(data)} bytes", f"at most {largest} bytes")
    return bytes(data.to_bytes())


def check_loopback(endpoint: str) -> None:
    """Check that nobody outside of this computer can connect to an endpoint.

    Raises:
        ConfigError: It is not on the loopback interface.
    """
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
