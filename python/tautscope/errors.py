"""What can go wrong: one base class, one subclass per cause, each carrying the facts."""

from __future__ import annotations


class TautscopeError(Exception):
    """Base of every error this package raises on purpose."""


class FieldError(TautscopeError, ValueError):
    """A named input holds what it may not.

    Args:
        field: Where, as a path the user can find (``insertion.free_gain``, ``reference``).
        value: What came.
        allowed: What may come, in words.
    """

    def __init__(self, field: str, value: object, allowed: str) -> None:
        self.field = field
        self.value = value
        self.allowed = allowed
        super().__init__(f"{field}: got {value!r}, expected {allowed}")

    def __reduce__(self) -> tuple[type[FieldError], tuple[str, object, str]]:
        """Pickle by the facts, so that the error survives the way back from a worker process."""
        return type(self), (self.field, self.value, self.allowed)


class ConfigError(FieldError):
    """A configuration value is unknown, of the wrong type or out of range."""


class FrameError(FieldError):
    """An image is not what a camera of this configuration gives."""


class SignalError(FieldError):
    """A reference or command is not three finite numbers."""


class RecordError(FieldError):
    """A recorded file lacks a column or holds what is not a number."""


class MissingPathError(FieldError):
    """A file or folder that was asked for is not there, or holds nothing usable."""


class OutputError(FieldError):
    """A result cannot be written where it was asked for."""


class DriveError(TautscopeError):
    """A failure of a drive or its bus that must stop the run.

    Args:
        node: The drive (``rotation, node 2``) or the bus.
        what: What happened.
        remedy: What to do.
    """

    def __init__(self, node: str, what: str, remedy: str) -> None:
        self.node = node
        self.what = what
        self.remedy = remedy
        super().__init__(f"{node}: {what}. {remedy}")

    def __reduce__(self) -> tuple[type[DriveError], tuple[str, str, str]]:
        """Pickle by the facts, so that the error survives the way back from a worker process."""
        return type(self), (self.node, self.what, self.remedy)


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


class CameraMismatchError(CameraError):
    """A source that differs from its configuration; reopening it does not help."""
