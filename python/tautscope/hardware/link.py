"""The seam between what a drive is told and the bus that carries it."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from tautscope.dof import Dof
from tautscope.errors import SettingRefusedError
from tautscope.hardware.cia402 import Mode
from tautscope.hardware.object_dictionary import Entry


class Answer(NamedTuple):
    """What a drive says in a cycle, on every bus: 0x6041, 0x6064 [counts], 0x6061."""

    statusword: int
    position: int
    mode: int

    @classmethod
    def unpack(cls, data: bytes) -> Answer:
        """From process data of at least `ANSWER_SIZE` bytes."""
        return cls(*_ANSWER.unpack_from(data))


_ANSWER = struct.Struct("<Hib")
ANSWER_SIZE = _ANSWER.size
NO_ANSWER = Answer(0, 0, 0)


@dataclass(frozen=True, slots=True)
class Feedback:
    """What a drive last said.

    Attributes:
        statusword, position, mode: As in `Answer`.
        age: Cycles since it said so; 0 in this one.
        answers: How often it has said so since the link began.
        silence: Time since it said so [s].
    """

    statusword: int
    position: int
    mode: int
    age: int
    answers: int
    silence: float


class AbsentError(SettingRefusedError):
    """A drive does not have the object that was asked for."""


class Link(Protocol):
    """Three drives, one per DOF, on some bus.

    Every member may raise `tautscope.errors.DriveError`: the bus is gone, a drive does not answer,
    sent an emergency, or lost its heartbeat.
    """

    def name(self, dof: Dof) -> str:
        """The drive as a person finds it."""
        ...

    def read(self, dof: Dof, entry: Entry) -> int:
        """A value from a drive's object dictionary.

        Raises:
            AbsentError: It does not have that object.
        """
        ...

    def write(self, dof: Dof, entry: Entry, value: int) -> None:
        """Set a value; it is not read back.

        Raises:
            AbsentError: The drive does not have that object.
            SettingRefusedError: It refused the value.
        """
        ...

    def prepare(self, modes: Mapping[Dof, Mode]) -> None:
        """Set what watches the connection and what each cycle carries; the drives stay disabled."""
        ...

    def operational(self) -> None:
        """Begin to exchange process data; from here on `cycle` must be called in time."""
        ...

    def cycle(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """Send a controlword and a target [counts] to each drive and wait for their answers.

        Waits no longer than `reply_timeout`.
        """
        ...

    def halt(self, controlword: int, targets: Sequence[int]) -> list[Feedback]:
        """As `cycle`, with one controlword for every drive, whatever else is wrong on the bus."""
        ...

    def abandon(self, dofs: Sequence[Dof]) -> None:
        """Make drives that do not answer stop by themselves; raises nothing."""
        ...

    def close(self) -> None:
        """Release the bus; may be called twice."""
        ...
