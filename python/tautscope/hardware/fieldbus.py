"""The interface between the drive logic and the fieldbus that connects the drives."""

import struct
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from tautscope.config import DrivesConfig
from tautscope.config.drives import WAIVERS, waiver_hint
from tautscope.dof import Motor
from tautscope.errors import SettingRefusedError
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode
from tautscope.hardware.drive_group import Feedback
from tautscope.hardware.object_dictionary import Entry

TX_PDO = struct.Struct("<Hib")
"""Process data of a drive: the values of `TX_PDO_OBJECTS`."""
TX_PDO_OBJECTS = (objects.STATUSWORD, objects.POSITION_ACTUAL, objects.MODE_DISPLAY)


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


class Fieldbus(ABC):
    """The drives of a rig, one per motor, on one bus.

    Every method may raise `tautscope.errors.DriveError`: the bus is lost, or a drive does not
    answer, has sent an emergency object or no heartbeat.

    Attributes:
        names: The drives' names for messages: DOF and node.
    """

    names: Sequence[str]

    def read(self, dof: Motor, entry: Entry) -> int:
        """Read a value from a drive's object dictionary; `AbsentError` if the drive lacks it."""
        return entry.decode(self._transfer(dof, entry, entry))

    def read_or_zero(self, dof: Motor, entry: Entry) -> int:
        """`read`; 0 if the drive lacks the object."""
        try:
            return self.read(dof, entry)
        except AbsentError:
            return 0

    def write(self, dof: Motor, entry: Entry, value: int) -> None:
        """Write a value to a drive's object dictionary; it is not read back.

        Raises:
            AbsentError: The drive lacks the object.
            SettingRefusedError: The drive refused the value, or the object cannot hold it.
        """
        size = self._size(dof, entry)
        try:
            data = value.to_bytes(size, "little", signed=entry.signed)
        except OverflowError:
            raise SettingRefusedError(
                self.names[dof],
                f"{entry} cannot hold {value} in {size} bytes",
                "Check counts_per_unit and speed_limit of this motor, and its EDS file if it has "
                "one",
            ) from None
        self._transfer(dof, entry, f"{entry} = {value}", data)

    def verify(self, dof: Motor, entry: Entry, value: int) -> None:
        """Read a setting back; `SettingRefusedError` if the drive holds another value."""
        found = self.read(dof, entry)
        if found != value:
            raise SettingRefusedError(
                self.names[dof],
                f"{entry} was set to {value} (0x{value:X}) and reads back {found} (0x{found:X})",
                "Look up in its manual which values it accepts, and in which state",
            )

    @abstractmethod
    def configure(self, modes: Mapping[Motor, Mode]) -> None:
        """Configure connection supervision and process data; the drives stay disabled."""

    @abstractmethod
    def start(self) -> None:
        """Start the exchange of process data; from now on `exchange` must be called in time."""

    @abstractmethod
    def exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """Send a controlword and a target position [counts] to each drive and wait for answers.

        Waits no longer than `reply_timeout`.
        """

    @abstractmethod
    def broadcast(self, controlword: int, targets: Sequence[int]) -> list[Feedback]:
        """Like `exchange` with one controlword for all drives, without any fault check."""

    @abstractmethod
    def stop_communication(self, dofs: Sequence[Motor]) -> None:
        """End communication so that the drives' own supervision stops them; raises nothing."""

    @abstractmethod
    def close(self) -> None:
        """Release the bus; a second call does nothing."""

    def _size(self, dof: Motor, entry: Entry) -> int:
        """Length of a value in a drive [byte]."""
        return entry.size

    @abstractmethod
    def _transfer(self, dof: Motor, entry: Entry, what: object, data: bytes | None = None) -> bytes:
        """Write a value by SDO download, or without `data` read it; `what` is for errors."""


def target_object(mode: Mode) -> Entry:
    """The object that takes the set-points of a mode."""
    is_interpolated = mode is Mode.INTERPOLATED_POSITION
    return objects.INTERPOLATION_DATA if is_interpolated else objects.TARGET_POSITION
