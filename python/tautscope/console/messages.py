"""Messages between page, web server and control process, with their ranges.

Whatever a page sends is decoded into one of these types or refused.
"""

from typing import Annotated, Any, Literal, TypeAlias

import msgspec
from msgspec import Meta, Struct

from tautscope._core import MOST_DOFS

LARGEST_MESSAGE = 2048
"""Longest message that is read [byte]."""
Count = Annotated[int, Meta(ge=0, lt=2**53)]
"""An integer that JavaScript represents exactly."""
Axis = Annotated[float, Meta(ge=-1, le=1)]
Share = Annotated[float, Meta(ge=0, le=1)]
Text = Annotated[str, Meta(max_length=200)]
Pixel = Annotated[float, Meta(ge=0, lt=2**16)]
Axes = Annotated[tuple[Axis, ...], Meta(min_length=1, max_length=MOST_DOFS)]
DofName = Annotated[str, Meta(max_length=32)]
ActionName = Literal[
    "acknowledge",
    "enable",
    "end_program",
    "experiment",
    "home",
    "mark",
    "record",
    "release",
    "still",
    "sweep",
]


class _Message(Struct, frozen=True, forbid_unknown_fields=True, tag_field="type"):
    """A message of a page."""


class Hello(_Message, frozen=True, tag="hello"):
    """The first message of a connection."""

    token: Annotated[str, Meta(max_length=100)]


class Stop(_Message, frozen=True, tag="stop"):
    """Stop all motion; needs no lease."""


class Take(_Message, frozen=True, tag="take"):
    """Take the lease, also from its holder."""


class Command(_Message, frozen=True):
    """What only the holder of the lease may send.

    `sequence` grows from command to command; `image` is the sequence of the image displayed.
    """

    lease: Count
    sequence: Count
    image: Count


class Servo(Command, frozen=True, tag="servo"):
    """The deflection of the input device, sent periodically.

    Attributes:
        axes: (n,) speeds [of the largest speed times scale].
        is_holding: Whether the operator holds the device's enabling button.
        point: (u, v) [px of the camera] pointed at in the image, in place of deflections.
    """

    axes: Axes
    is_holding: bool
    point: tuple[Pixel, Pixel] | None = None


class Action(Command, frozen=True, tag="action"):
    """A request without a value, or with the text of a mark."""

    name: ActionName
    text: Text = ""


class Setting(Command, frozen=True, tag="setting"):
    """A changed setting.

    Attributes:
        name: ``compensation``, a share from 0 to 1; ``scale``, of a DOF; ``clutch``, 1 couples
            a DOF to the input device and 0 does not.
        dof: Name of the DOF of ``scale`` and ``clutch``.
    """

    name: Literal["compensation", "scale", "clutch"]
    value: Share
    dof: DofName = ""


class SetProfile(Command, frozen=True, tag="profile"):
    """Another profile of compensation; the estimates start anew."""

    profile: Literal["paper", "best"]


class Seek(_Message, frozen=True, tag="seek"):
    """Show another time of a recording; needs no lease, and does nothing else.

    Attributes:
        time: From its begin [s]; None to stay.
        is_playing: Whether time goes on.
    """

    time: Annotated[float, Meta(ge=0, le=1e9)] | None
    is_playing: bool


class Drawn(_Message, frozen=True, tag="drawn"):
    """The image of a sequence has been drawn, `width` pixels of the page's screen wide."""

    image: Count
    width: Annotated[int, Meta(ge=0, le=16384)]


LONGEST_REASON = 500
"""Characters of an error shown at most; escaped, they fit into a record of shared memory."""
Request: TypeAlias = Action | Setting | SetProfile
"""Commands that are executed once, in their order."""
ControlMessage: TypeAlias = Stop | Take | Seek | Servo | Request

decode_hello = msgspec.json.Decoder(Hello).decode
decode_control = msgspec.json.Decoder(ControlMessage).decode
decode_video = msgspec.json.Decoder(Drawn).decode


class Received(Struct, frozen=True, tag=True):
    """A message with its connection, from the web server to the control process.

    Attributes:
        client: Number of the connection; the page cannot choose it.
        at: When it arrived [s, monotonic clock].
    """

    client: int
    at: float
    message: ControlMessage


class Gone(Struct, frozen=True, tag=True):
    """A connection has ended."""

    client: int


class Reply(Struct, frozen=True):
    """Result of a command, from the control process to a page.

    Attributes:
        client: Number of the page's connection.
        what: The command.
        reason: Why it was not executed, or what a person should know of what was done.
    """

    client: int
    what: str
    is_accepted: bool
    reason: str = ""


encode = msgspec.json.Encoder().encode
decode_received = msgspec.json.Decoder(Received).decode
decode_inbound = msgspec.json.Decoder(Received | Gone).decode
decode_reply = msgspec.json.Decoder(Reply).decode
decode_state = msgspec.json.Decoder(dict[str, Any]).decode
