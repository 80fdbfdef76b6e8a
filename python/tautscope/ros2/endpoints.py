"""Publishers, subscriptions and services of a node.

Nothing here calls back: messages wait in channels of Zenoh, outside Python, until they are taken.
A control loop that takes them is never interrupted by one.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from tautscope.errors import MessageError
from tautscope.ros2 import types, wire

IMAGE = "sensor_msgs/msg/Image"
LARGEST = 2**16
"""Longest message that is decoded, but for images [byte]: a tick must not wait for a longer one."""
Handler = Callable[[Any], dict[str, Any]]
"""Makes the fields of the response to a request."""
Refuse = Callable[[MessageError], None]
"""Called with the reason for which a message is refused."""
Read = TypeVar("Read")
LARGEST_IMAGE = 2**26
"""Longest image that is decoded [byte]."""


class Publisher:
    """Publishes messages of one topic; made by `Node.publisher`."""

    def __init__(self, kind: str, publisher: Any, source: bytes) -> None:
        self._kind, self._publisher, self._source = kind, publisher, source
        self._sequence = 0

    def publish(self, message: Any) -> None:
        """Send a message, or one of these fields.

        What the transport cannot take in 1 ms, images in 50 ms, is dropped.
        """
        if isinstance(message, Mapping):
            message = types.make(self._kind, **message)
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
        missed: Number of messages between these that were lost, or replaced by newer ones.
        source: Identifier of the publisher of the last message; empty if it has none.
    """

    def __init__(self, topic: str, kind: str, subscriber: Any) -> None:
        self.topic, self._kind, self._subscriber = topic, kind, subscriber
        self._largest = LARGEST_IMAGE if kind == IMAGE else LARGEST
        self.received = self.missed = 0
        self.source = b""
        self._sequence = 0

    def take(self) -> Any | None:
        """The oldest message that waits, or None; a `MessageError` if it cannot be decoded."""
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

    def read(self, convert: Callable[[Any], Read], refuse: Refuse, most: int = 1) -> list[Read]:
        """What the oldest messages that wait are converted to; the wrong ones are refused."""
        found = []
        for _ in range(most):
            try:
                if (message := self.take()) is None:
                    break
                found.append(convert(message))
            except MessageError as error:
                refuse(error)
        return found


class Service:
    """Requests to a service; made by `Node.service`."""

    def __init__(self, kind: str, queryable: Any, handler: Handler) -> None:
        self._kind, self._queryable, self._handler = kind, queryable, handler

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
            response = types.make(f"{self._kind}_Response", **self._handler(request))
        except MessageError as error:
            query.reply_err(str(error).encode())
            return
        attachment = wire.attachment(sequence, time.time_ns(), source)
        query.reply(query.key_expr, types.encode(response), attachment=attachment)


def _payload(data: Any, largest: int) -> bytes:
    if len(data) > largest:
        raise MessageError("message", f"{len(data)} bytes", f"at most {largest} bytes")
    return bytes(data.to_bytes())
