"""Sensors of the tip that are nodes of ROS."""

from functools import partial
from typing import Any

from tautscope.config import Config
from tautscope.loop.measurement import Measurement
from tautscope.ros2.endpoints import Refuse
from tautscope.ros2.inputs import checked_stamp
from tautscope.ros2.measurements import KINDS, MeasurementReader
from tautscope.ros2.session import Clock, Node
from tautscope.ros2.wire import Qos

QUEUE = 10
"""Number of messages of a sensor that wait for a tick; it takes all."""


class Sensors:
    """Measurements by the messages of `measurement.topics`.

    A stamp is converted to the rig's clock by its age. What is late, repeated or out of order is
    left to the loop.
    """

    def __init__(self, config: Config, node: Node, clock: Clock, refuse: Refuse) -> None:
        self._clock, self._refuse = clock, refuse
        # Best effort also receives what a publisher sends reliably.
        quality = Qos(depth=QUEUE, is_reliable=False)
        self._topics = [
            node.subscription(topic.name, KINDS[topic.type], quality)
            for topic in config.measurement.topics
        ]
        self._readers = [
            MeasurementReader(config, sensor, topic.topic)
            for sensor, topic in enumerate(self._topics)
        ]

    def reset(self) -> None:
        """Discard what arrived before, and take the next messages' frames."""
        self.take(0.0)
        for reader in self._readers:
            reader.reset()

    def take(self, now: float) -> tuple[Measurement, ...]:
        """What has arrived since the last call, at a time of the rig's clock [s]."""
        found: list[Measurement] = []
        for topic, reader in zip(self._topics, self._readers, strict=True):
            convert = partial(self._measurement, topic.topic, reader, now)
            found += [each for each in topic.read(convert, self._refuse, QUEUE) if each is not None]
        return tuple(found)

    def _measurement(
        self, topic: str, reader: MeasurementReader, now: float, message: Any
    ) -> Measurement | None:
        wall = self._clock.wall()
        age = wall - checked_stamp(topic, message.header, wall)
        return reader.read(message, now - age / 1e9)
