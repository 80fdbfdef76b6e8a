"""The interface of the drives of a rig, whatever their protocol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from tautscope.dof import Motor


class Feedback(Protocol):
    """What a drive reported last."""

    @property
    def position(self) -> int:
        """Position actual value [counts]."""
        ...

    @property
    def age(self) -> int:
        """Cycles since it was received; 0 if it came in the present cycle."""
        ...

    @property
    def answers(self) -> int:
        """Number of answers since the bus was opened."""
        ...

    @property
    def silence(self) -> float:
        """Time since the last answer [s]."""
        ...

    @property
    def reports_following_error(self) -> bool:
        """Whether the drive itself reports a following error."""
        ...


@dataclass(slots=True)
class NewestAnswer:
    """The newest answer of a motor on a serial line: a `Feedback`."""

    position: int = 0
    age: int = 0
    answers: int = 0
    silence: float = 0.0
    reports_following_error: bool = False
    answered_at: float = 0.0


@dataclass(frozen=True, slots=True)
class CommissionedDrive:
    """A drive's identity and settings.

    Attributes:
        name: Its name for messages.
        vendor, product: Numbers in its identity; 0 where they are missing.
        mode: The mode of operation it entered; 0 is not shown.
        settings: Setting and value as read back.
        absent: Settings that the drive lacks.
    """

    name: str
    vendor: int
    product: int
    mode: int
    settings: dict[str, int]
    absent: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class DriveStatus:
    """What a drive reports before anything is written to it.

    Attributes:
        position: Position actual value [counts].
        found: Identity and state in words.
        problem: What to do before it can be used; empty if nothing.
        serial_number: Empty where it is missing.
        data: The same for scripts.
    """

    position: int
    found: str
    problem: str
    serial_number: str = ""
    data: dict[str, Any] = field(default_factory=dict)


class DriveGroup(Protocol):
    """The drives of a rig, one per motor, on one bus; for use by one thread.

    Every method may raise `tautscope.errors.DriveError`: the bus is lost, or a drive does not
    answer or reports a fault. Positions are in counts, see `tautscope.hardware.scale.Scale`.
    """

    @property
    def pending(self) -> int:
        """Number of newest set-points that cannot have an effect yet when positions are read."""
        ...

    def name(self, dof: Motor) -> str:
        """The drive's name for messages: DOF and node."""
        ...

    def serial_number(self, dof: Motor) -> str:
        """The drive's serial number; empty where it is missing."""
        ...

    def status(self, dof: Motor) -> DriveStatus:
        """Read identity, state and position; nothing is written."""
        ...

    def commission(self, dof: Motor) -> CommissionedDrive:
        """Set protections, limits and mode, and read them back; the drive stays disabled.

        Raises:
            ModeRefusedError: It cannot follow a stream of positions.
            SettingRefusedError: A setting was refused, or reads back differently.
        """
        ...

    def configure(self) -> None:
        """Configure the supervision of the connection, after `commission` of every drive."""
        ...

    def read_positions(self) -> list[int]:
        """Read the positions while the drives are disabled."""
        ...

    def start(self, positions: list[int]) -> None:
        """Start the exchange at these positions; from now on it must go on in time."""
        ...

    def probe(self) -> Sequence[Feedback]:
        """Exchange one cycle in which no motor is enabled."""
        ...

    def enable(self, *, reset_faults: bool) -> Sequence[Feedback]:
        """Enable the motors where they are, and cycle until they follow set-points.

        Raises:
            StateError: A drive is in fault, or did not become enabled within `state_timeout`.
        """
        ...

    def exchange(self, targets: list[int]) -> Sequence[Feedback]:
        """Send a set-point to each drive and wait for answers, no longer than `reply_timeout`."""
        ...

    def quick_stop(self) -> list[str]:
        """Stop all motors; names of those that do not confirm it within `state_timeout`.

        Does nothing if they never ran, or are stopped already.
        """
        ...

    def disable(self) -> list[str]:
        """`quick_stop`, then switch the motors off; names of those that do not confirm it."""
        ...

    def close(self) -> None:
        """Release the bus; a second call does nothing."""
        ...
