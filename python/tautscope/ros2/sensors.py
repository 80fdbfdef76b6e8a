"""Sensors of the tip that are nodes of ROS."""

from tautscope.config import Config
from tautscope.errors import MessageError
from tautscope.loop.measurement import Measurement
from tautscope.ros2.clock import Clock
from tautscope.ros2.inputs import checked_stamp
from tautscope.ros2.measurements import KINDS, MeasurementReader
from tautscope.ros2.references import Refuse
from tautscope.ros2.session import Node
from tautscope.ros2.wire import Qos

QUEUE = 10
"""Number of messages of a sensor that wait for a tick; it takes all."""


class Sensors:
    """Measurements by the messages of `measurement.topics`.

    A stamp is converted to the rig's clock by its age. What is late, repeated or out of order is
    left to the loop.

    Args:
        config: With topics.
        node: Subscribes.
        clock: Clock of the stamps.
        refuse: Called for refused messages.
    """

    def __init__(self, config: Config, node: Node, clock: Clock, refuse: Refuse) -> None:
        self._clock, self._refuse = clock, refuse
        self._config = config
        # Best effort also receives what a publisher sends reliably.
        quality = Qos(depth=QUEUE, is_reliable=False)
        self._topics = [
            node.subscription(topic.name, KINDS[topic.type], quality)
            for topic in config.measurement.topics
        ]
        self._make_readers()

    def reset(self) -> None:
        """Discard what arrived before, and take the next messages' frames."""
        self.take(0.0)
        self._make_readers()

    def take(self, now: float) -> tuple[Measurement, ...]:
        """What has arrived since the last call, at a time of the rig's clock [s]."""
        found = []
        for topic, reader in zip(self._topics, self._readers, strict=True):
            for _ in range(QUEUE):
                try:
                    message = topic.take()
                    if message is None:
                        break
                    wall = self._clock.wall()
                    age = wall - checked_stamp(topic.topic, message.header, wall)
                    measurement = reader.read(message, now - age / 1e9)
                    if measurement is not None:
                        found.append(measurement)
                except MessageError as error:
                    self._refuse(error)
        return tuple(found)

    def _make_readers(self) -> None:
        self._readers = [
            MeasurementReader(self._config, sensor, topic.topic)
            for sensor, topic in enumerate(self._topics)
        ]
