"""The interface between the drive logic and the fieldbus that connects the drives."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from tautscope.config import DrivesConfig
from tautscope.config.drives import WAIVERS, waiver_hint
from tautscope.dof import Motor
from tautscope.errors import SettingRefusedError
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import FOLLOWING_ERROR_BIT, Mode
from tautscope.hardware.object_dictionary import Entry


class TxPdo(NamedTuple):
    """Process data of a drive: statusword, position actual value [counts], mode display."""

    statusword: int
    position: int
    mode: int

    @classmethod
    def unpack(cls, data: bytes) -> TxPdo:
        """Decode process data of at least `TX_PDO_SIZE` bytes."""
        return cls(*_TX_PDO.unpack_from(data))


_TX_PDO = struct.Struct("<Hib")
TX_PDO_OBJECTS = (objects.STATUSWORD, objects.POSITION_ACTUAL, objects.MODE_DISPLAY)
"""The objects that `TxPdo` decodes, in order."""
TX_PDO_SIZE = _TX_PDO.size
EMPTY_TX_PDO = TxPdo(0, 0, 0)


@dataclass(frozen=True, slots=True)
class Feedback:
    """The newest process data of a drive.

    Attributes:
        statusword, position, mode: As in `TxPdo`.
        age: Cycles since it was received; 0 if it came in the present cycle.
        answers: Number of TxPDOs received since the bus was opened.
        silence: Time since the last TxPDO [s].
    """

    statusword: int
    position: int
    mode: int
    age: int
    answers: int
    silence: float

    @property
    def reports_following_error(self) -> bool:
        """Whether the drive reports a following error; in mode 7 the bit means another thing."""
        is_cyclic = self.mode == Mode.CYCLIC_SYNCHRONOUS_POSITION
        return is_cyclic and bool(self.statusword & FOLLOWING_ERROR_BIT)


class AbsentError(SettingRefusedError):
    """The drive's object dictionary lacks the requested object."""


def abort_error(name: str, what: object, code: int, text: object) -> SettingRefusedError:
    """The error for an SDO transfer that a drive aborted."""
    if code in (0x0602_0000, 0x0609_0011):  # object or sub-index does not exist
        return AbsentError(name, f"it does not have {what}", "Check that it is a CiA 402 drive")
    return SettingRefusedError(
        name,
        f"it refused {what}: abort code 0x{code:08X} ({text})",
        "Look up in its manual which values it accepts, and in which state",
    )


def encoded(name: str, entry: Entry, value: int, size: int) -> bytes:
    """A value as `size` little-endian bytes.

    Raises:
        SettingRefusedError: It does not fit.
    """
    try:
        return value.to_bytes(size, "little", signed=entry.signed)
    except OverflowError:
        raise SettingRefusedError(
            name,
            f"{entry} cannot hold {value} in {size} bytes",
            "Check counts_per_unit and speed_limit of this motor, and its EDS file if it has one",
        ) from None


def require_waived(config: DrivesConfig, entry: Entry, error: SettingRefusedError) -> None:
    """Raise the error with its waiver as remedy, unless the object is waived.

    Raises:
        SettingRefusedError: The object is not waived.
    """
    waiver = next((name for name in WAIVERS if name == f"{entry.index:04X}"), None)
    if waiver is None:
        raise error
    if waiver not in config.waive:
        other = "" if isinstance(error, AbsentError) else f"{error.remedy}. "
        raise type(error)(error.node, error.what, other + waiver_hint(waiver)) from None


class Fieldbus(Protocol):
    """The drives of a rig, one per motor, on one bus.

    Every method may raise `tautscope.errors.DriveError`: the bus is lost, or a drive does not
    answer, has sent an emergency object or no heartbeat.
    """

    def name(self, dof: Motor) -> str:
        """The drive's name for messages: DOF and node."""
        ...

    def read(self, dof: Motor, entry: Entry) -> int:
        """Read a value from a drive's object dictionary.

        Raises:
            AbsentError: The drive lacks the object.
        """
        ...

    def write(self, dof: Motor, entry: Entry, value: int) -> None:
        """Write a value to a drive's object dictionary; it is not read back.

        Raises:
            AbsentError: The drive lacks the object.
            SettingRefusedError: The drive refused the value.
        """
        ...

    def configure(self, modes: Mapping[Motor, Mode]) -> None:
        """Configure connection supervision and process data; the drives stay disabled."""
        ...

    def start(self) -> None:
        """Start the exchange of process data; from now on `exchange` must be called in time."""
        ...

    def exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """Send a controlword and a target position [counts] to each drive and wait for answers.

        Waits no longer than `reply_timeout`.
        """
        ...

    def broadcast(self, controlword: int, targets: Sequence[int]) -> list[Feedback]:
        """Like `exchange` with one controlword for all drives, without any fault check."""
        ...

    def stop_communication(self, dofs: Sequence[Motor]) -> None:
        """End communication so that the drives' own supervision stops them; raises nothing."""
        ...

    def close(self) -> None:
        """Release the bus; a second call does nothing."""
        ...


def verify_setting(bus: Fieldbus, dof: Motor, entry: Entry, value: int) -> None:
    """Read a setting back.

    Raises:
        SettingRefusedError: The drive holds another value.
    """
    found = bus.read(dof, entry)
    if found != value:
        raise SettingRefusedError(
            bus.name(dof),
            f"{entry} was set to {value} (0x{value:X}) and reads back {found} (0x{found:X})",
            "Look up in its manual which values it accepts, and in which state",
        )


def target_object(mode: Mode) -> Entry:
    """The object that takes the set-points of a mode."""
    is_interpolated = mode is Mode.INTERPOLATED_POSITION
    return objects.INTERPOLATION_DATA if is_interpolated else objects.TARGET_POSITION
