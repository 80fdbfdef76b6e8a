"""Errors: one base class, one subclass per cause; each has the facts as attributes."""

import os
from typing import Any

USAGE, REFUSED, STOPPED = 2, 3, 4
"""Exit status of the command line: bad input; refused by the rig; stopped for safety."""
EMERGENCY_STOP = "Use the emergency stop"
"""Begins the remedy of an error, or of its notes, after which motors may still move."""


class TautscopeError(Exception):
    """Base class of all errors of this package.

    Attributes:
        exit_status: Exit status of a command that ends with it.
    """

    exit_status = USAGE


class FieldError(TautscopeError, ValueError):
    """An input has a value that is not allowed.

    Args:
        field: Name of the input, as the user knows it (``insertion.free_gain``, ``reference``).
        value: Its value.
        allowed: Allowed values, in words.
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        self.field = field
        self.value = value
        self.allowed = allowed
        super().__init__(field, value, allowed)

    def __str__(self) -> str:
        return f"{self.field}: got {self.value!r}, expected {self.allowed}"


class ConfigError(FieldError):
    """A configuration value is unknown, of the wrong type or out of range."""


class FrameError(FieldError):
    """An image does not have the shape or type of the configured camera."""


class SignalError(FieldError):
    """A signal has the wrong shape, or a value that is not a finite number."""


class RecordError(FieldError):
    """A recorded file lacks a column, or a cell is not a number."""


class MessageError(FieldError):
    """A message cannot be decoded, or has a value that is not allowed; it has changed nothing."""


class MissingPathError(FieldError):
    """A file or folder does not exist, or has no usable content."""

    def __str__(self) -> str:
        if os.access(str(self.value), os.F_OK):  # False, too, where nobody may look
            return super().__str__()
        kind = "Folder" if self.allowed.startswith("a folder") else "File"
        return f"{kind} not found: {self.value}. Expected {self.allowed}"


class OutputError(FieldError):
    """A result cannot be written to the given place."""


class CalibrationError(TautscopeError):
    """Images or motions do not determine what is to be calibrated.

    Args:
        what: What was found.
        remedy: What to do.
    """

    def __init__(self, what: str, remedy: str) -> None:
        self.what = what
        self.remedy = remedy
        super().__init__(what, remedy)

    def __str__(self) -> str:
        return f"{self.what}. {self.remedy}"


class MissingExtraError(TautscopeError, ImportError):
    """An optional dependency is not installed.

    Args:
        what: What needs it.
        modules: The missing modules.
        extras: The extras of this package that install them.
    """

    def __init__(self, what: str, modules: tuple[str, ...], extras: tuple[str, ...]) -> None:
        self.what = what
        self.modules = modules
        self.extras = extras
        super().__init__(what, modules, extras)

    def __str__(self) -> str:
        extras = ",".join(self.extras)
        return (
            f"{self.what} needs {', '.join(self.modules)}; type: "
            f'python -m pip install "tautscope[{extras}]"'
        )


class MotionHeldError(TautscopeError):
    """Motion was held, and nobody could re-engage it.

    Args:
        time: Since when [s, the rig's clock].
        reaction: The reaction in force, `tautscope.loop.safety.Reaction`.
        flags: The flags in force, by the names of `tautscope.loop.safety.DETECTORS`.

    Attributes:
        recording: `tautscope.runs.recording.Recording` of the run up to its end, if there is one.
    """

    exit_status = STOPPED

    def __init__(self, time: float, reaction: str, flags: tuple[str, ...]) -> None:
        self.time = time
        self.reaction = reaction
        self.flags = flags
        self.recording: Any = None
        super().__init__(time, reaction, flags)

    def __str__(self) -> str:
        return (
            f"Motion stopped at {self.time:.3f} s ({self.reaction}: {', '.join(self.flags)}), and "
            "nobody re-engaged it. docs/safety.md explains the flags. Remove the cause and repeat "
            "the run, or give run_experiment a function `engage`"
        )


class DriveError(TautscopeError):
    """A failure of a drive or its bus that must stop the run.

    Args:
        node: The drive (``rotation, node 2``) or the bus.
        what: What happened.
        remedy: What to do.
    """

    exit_status = REFUSED

    def __init__(self, node: str, what: str, remedy: str) -> None:
        self.node = node
        self.what = what
        self.remedy = remedy
        super().__init__(node, what, remedy)

    def __str__(self) -> str:
        return f"{self.node}: {self.what}. {self.remedy}"


class BusError(DriveError):
    """The bus cannot be opened, or the connection to it is lost."""


class SecondMasterError(DriveError):
    """Another master commands drives on the same bus."""


class SettingRefusedError(DriveError):
    """A drive refused a setting, or the value read back differs."""


class ModeRefusedError(DriveError):
    """A drive has no mode that follows a stream of positions, or did not enter it."""


class StateError(DriveError):
    """A drive did not reach a state, or left it unexpectedly."""


class EmergencyError(DriveError):
    """A drive sent an emergency object."""


class HeartbeatError(DriveError):
    """A drive's heartbeat is missing."""


class SilentDriveError(DriveError):
    """A drive does not answer set-points or SDO requests."""


class FollowingError(DriveError):
    """The following error is too large, or a position jumped or is outside the travel."""


class CameraError(FieldError):
    """A camera is missing, or does not deliver usable images."""

    exit_status = REFUSED


class NoRigError(CameraError):
    """Nothing answers on the sockets of the bench."""

    def __str__(self) -> str:
        return f"No rig answers on {self.value}: start `tautscope bench`"


class CameraMismatchError(CameraError):
    """A source that differs from its configuration; reopening it does not help."""


def notes(error: BaseException) -> list[str]:
    """Notes of an error, and what says of errors that it replaced that motors may still move.

    A second Ctrl-C while motors stop replaces the error that tells it.
    """
    found: list[str] = list(getattr(error, "__notes__", ()))
    replaced = error.__context__
    while replaced is not None:
        texts = [str(replaced), *getattr(replaced, "__notes__", ())]
        found += [text for text in texts if EMERGENCY_STOP in text and text not in found]
        replaced = replaced.__context__
    return found


def described(error: BaseException) -> str:
    """An error with its `notes`."""
    return "; ".join(filter(None, [str(error), *notes(error)]))


def may_move(error: BaseException) -> bool:
    """Whether motors may still move after an error: their stop is not confirmed."""
    return EMERGENCY_STOP in described(error)
