"""Names and attachments of rmw_zenoh: what makes Zenoh data topics and services of ROS 2.

From the design document of rmw_zenoh (ros2/rmw_zenoh, docs/design.md). A topic is the key
``domain/name/type/hash``. A liveliness token per node, publisher, subscription and service makes
them visible to `ros2 node list` and `ros2 topic list`. Every message has an attachment.
"""

import hashlib
import struct
from dataclasses import dataclass
from enum import StrEnum

from tautscope.errors import MessageError

HUMBLE, JAZZY = "humble", "jazzy"
"""Distributions of ROS whose keys differ: those of Jazzy and later ones have type hashes."""
NO_HASH = "TypeHashNotSupported"
"""What the keys of Humble have in place of a type hash."""
_GID_SIZE = 16
_ATTACHMENT = struct.Struct(f"<qqB{_GID_SIZE}s")


class Entity(StrEnum):
    """Kind of a liveliness token."""

    NODE = "NN"
    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVICE = "SS"


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of a topic: volatile, keep the last, send lost ones again if reliable."""

    depth: int = 10
    is_reliable: bool = True

    def __str__(self) -> str:
        """As in a liveliness token; what is empty has the default."""
        return f"{'' if self.is_reliable else 2}::,{self.depth}:,:,:,,"


@dataclass(frozen=True, slots=True)
class Identity:
    """A node in the network; its namespace is empty, or begins with a slash."""

    domain: int
    session: str
    namespace: str
    name: str

    @property
    def path(self) -> str:
        """The fully qualified name."""
        return f"{self.namespace}/{self.name}"

    def node_token(self) -> str:
        """Liveliness token of the node."""
        return self._token(0, Entity.NODE)

    def token(
        self, number: int, entity: Entity, topic: str, *, kind: str, rihs: str, qos: Qos
    ) -> str:
        """Liveliness token of a publisher, subscription or service; `number` is unique."""
        names = f"{_mangled(topic)}/{dds_name(kind)}/{rihs}/{qos}"
        return f"{self._token(number, entity)}/{names}"

    def _token(self, number: int, entity: Entity) -> str:
        namespace = _mangled(self.namespace) or "%"
        place = f"{self.domain}/{self.session}/0/{number}/{entity}"
        return f"@ros2_lv/{place}/%/{namespace}/{self.name}"


def key(domain: int, topic: str, kind: str, rihs: str) -> str:
    """Key of a topic or service."""
    return f"{domain}/{topic.strip('/')}/{dds_name(kind)}/{rihs}"


def dds_name(kind: str) -> str:
    """``sensor_msgs/msg/Image`` as ``sensor_msgs::msg::dds_::Image_``."""
    package, folder, name = kind.split("/")
    return f"{package}::{folder}::dds_::{name}_"


def gid(token: str) -> bytes:
    """Identifier of a publisher or client."""
    return hashlib.sha256(token.encode()).digest()[:_GID_SIZE]


def attachment(sequence: int, sent_at: int, source: bytes) -> bytes:
    """Attachment of a message: its number, wall clock time [ns], and the source's `gid`."""
    return _ATTACHMENT.pack(sequence, sent_at, _GID_SIZE, source)


def read_attachment(data: bytes) -> tuple[int, int, bytes]:
    """Number, wall clock time [ns] and source of a message of rmw_zenoh; else a `MessageError`."""
    try:
        sequence, sent_at, size, source = _ATTACHMENT.unpack(data)
        if size != _GID_SIZE:
            raise ValueError(f"identifier of {size} bytes")
    except (struct.error, ValueError) as error:
        raise MessageError("attachment", str(error), "that of rmw_zenoh, 33 bytes") from None
    return sequence, sent_at, source


def _mangled(name: str) -> str:
    return name.replace("/", "%")
