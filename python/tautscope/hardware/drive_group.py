"""The interface of the drives of a rig, whatever their protocol."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import DriveError, StateError
from tautscope.hardware.cia402 import FOLLOWING_ERROR_BIT, Mode

RESET = (
    "power-cycle it, or run tautscope jog with --reset-faults, in Python "
    "Drives.start(reset_faults=True)"
)
"""How a fault is reset, for messages, after its cause has been found."""
_RESTS = 3
"""Cycles without motion that show rest; a drive may report one position twice."""


@dataclass(slots=True)
class Feedback:
    """What a drive reported last.

    Attributes:
        position: Position actual value [counts].
        age: Cycles since it was received; 0 if it came in the present cycle.
        answers: Number of answers since the bus was opened.
        answered_at: Time of the last one [s, monotonic clock].
        silence: Time since the last one [s].
        statusword, mode: Of a CiA 402 drive.
    """

    position: int = 0
    age: int = 0
    answers: int = 0
    answered_at: float = 0.0
    silence: float = 0.0
    statusword: int = 0
    mode: int = 0

    @property
    def reports_following_error(self) -> bool:
        """Whether the drive reports a following error; in mode 7 the bit means another thing."""
        is_cyclic = self.mode == Mode.CYCLIC_SYNCHRONOUS_POSITION
        return is_cyclic and bool(self.statusword & FOLLOWING_ERROR_BIT)


@dataclass(frozen=True, slots=True)
class CommissionedDrive:
    """A drive's identity and settings.

    Attributes:
        vendor, product, mode: Of a CiA 402 drive; 0 where they are missing.
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


class DriveGroup(ABC):
    """The drives of a rig, one per motor, on one bus; for use by one thread.

    Every method may raise `tautscope.errors.DriveError`: the bus is lost, or a drive does not
    answer or reports a fault. Positions are in counts, see `tautscope.hardware.scale.Scale`.

    Args:
        config: Drives, limits and timeouts.
        names: The drives' names for messages: DOF and node.
        close: Releases the bus; a second call does nothing.
    """

    def __init__(
        self, config: DrivesConfig, names: Sequence[str], close: Callable[[], None]
    ) -> None:
        self._config, self.names, self.close = config, names, close
        self._feedback = [Feedback() for _ in config.all_motors]
        self._sent_at = self._stopped_at = 0.0
        self._is_moving = self._was_enabled = self._is_unconfirmed = False

    @property
    def pending(self) -> int:
        """Number of newest set-points that cannot have an effect yet when positions are read."""
        return 1

    def serial_number(self, dof: Motor) -> str:
        """The drive's serial number; empty where it is missing."""
        return ""

    @abstractmethod
    def status(self, dof: Motor) -> DriveStatus:
        """Read identity, state and position; nothing is written."""

    def may_move_if_set(self, dof: Motor) -> bool:
        """Whether `commission` changes settings of a motor that has torque."""
        return False

    @abstractmethod
    def commission(self, dof: Motor) -> CommissionedDrive:
        """Set protections, limits and mode, and read them back; the drive stays disabled.

        Raises:
            ModeRefusedError: It cannot follow a stream of positions.
            SettingRefusedError: A setting was refused, or reads back differently.
        """

    def configure(self) -> None:  # noqa: B027  not every bus needs it
        """Configure the supervision of the connection, after `commission` of every drive."""

    @abstractmethod
    def read_positions(self) -> list[int]:
        """Read the positions while the drives are disabled."""

    def start(self, positions: list[int]) -> None:
        """Start the exchange at these positions; from now on it must go on in time."""
        self._sent_at = time.monotonic()
        for one, position in zip(self._feedback, positions, strict=True):
            one.position, one.age, one.silence, one.answered_at = position, 0, 0.0, self._sent_at

    @abstractmethod
    def probe(self) -> list[Feedback]:
        """Exchange one cycle in which no motor is enabled."""

    @abstractmethod
    def enable(self, *, reset_faults: bool) -> list[Feedback]:
        """Enable the motors where they are, and cycle until they follow set-points.

        Raises:
            StateError: A drive is in fault, or did not become enabled within `state_timeout`.
        """

    @abstractmethod
    def exchange(self, targets: list[int]) -> list[Feedback]:
        """Send a set-point to each drive and wait for answers, no longer than `reply_timeout`."""

    def quick_stop(self, *, again: bool = False) -> list[str]:
        """Stop all motors; names of those that do not confirm it within `state_timeout`.

        Does nothing if they never ran or are stopped; `again` repeats a stop that is not confirmed.
        """
        if not (self._is_moving or (again and self._is_unconfirmed)):
            return []
        self._is_moving, self._stopped_at = False, time.monotonic()
        unconfirmed = self._stop()
        self._is_unconfirmed = bool(unconfirmed)
        return unconfirmed

    def disable(self) -> list[str]:
        """`quick_stop`, then switch the motors off; names of those that do not confirm both.

        Switching off alone would let a moving motor coast. Does nothing if they never ran.
        """
        if not self._was_enabled:
            return []
        unconfirmed = list(dict.fromkeys(self.quick_stop(again=True) + self._switch_off()))
        self._is_unconfirmed = bool(unconfirmed)
        return unconfirmed

    def remark(self) -> str:
        """What a bus knows of an error after its stop, for people; empty if nothing."""
        return ""

    @abstractmethod
    def _stop(self) -> list[str]:
        """Stop all motors; names of those that do not confirm it."""

    @abstractmethod
    def _switch_off(self) -> list[str]:
        """Switch all motors off; names of those that do not confirm it."""

    def _await_rest(self, hold: Callable[[], list[Feedback]]) -> None:
        """Call `hold` in each cycle until all motors rest, or `state_timeout` after their stop.

        Switched off while it slows down, a motor would coast.
        """
        before, rests = [one.position for one in self._feedback], 0
        deadline = self._stopped_at + self._config.state_timeout
        while rests < _RESTS and time.monotonic() < deadline:
            try:
                feedback = hold()
            except DriveError:
                return  # the bus is lost
            rests = rests + 1 if _are_at_rest(feedback, before) else 0
            before = [one.position for one in feedback]
            time.sleep(self._config.cycle)

    def _check_pause(self, name: str) -> None:
        """Note that a set-point is sent; `StateError` if the drives' watchdogs may have tripped."""
        now = time.monotonic()
        pause, self._sent_at = now - self._sent_at, now
        if pause > self._config.heartbeat_timeout:
            raise paused(name, self._config, pause)


def _are_at_rest(feedback: list[Feedback], before: list[int]) -> bool:
    """Whether all motors answer, from where they were in the cycle before."""
    pairs = zip(feedback, before, strict=True)
    return all(not one.age and abs(one.position - last) <= 1 for one, last in pairs)


def paused(name: str, config: DrivesConfig, pause: float) -> StateError:
    """The error for drives that stopped, or may have, because of a pause [s] of set-points."""
    return StateError(
        name,
        f"no set-point for {1e3 * pause:.0f} ms or more, and drives.heartbeat_timeout is "
        f"{1e3 * config.heartbeat_timeout:.0f} ms",
        "Check the load of this computer (tautscope doctor) and the line",
    )
