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
    """A drive or its bus did what must stop the run.

    Args:
        node: Which drive, as a person finds it (``rotation, node 2``), or the bus.
        what: What came, against what was asked.
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
    """The bus cannot be opened, was unplugged, or no longer takes or gives frames."""


class SecondMasterError(DriveError):
    """Somebody else commands drives on the same bus."""


class SettingRefusedError(DriveError):
    """A drive refused a setting, or reads back another value than was written."""


class ModeRefusedError(DriveError):
    """A drive has no mode that follows streamed positions, or did not enter it."""


class StateError(DriveError):
    """A drive did not reach a state, or left the one it should be in."""


class EmergencyError(DriveError):
    """A drive sent an emergency object."""


class HeartbeatError(DriveError):
    """A drive's heartbeat stayed away."""


class SilentDriveError(DriveError):
    """A drive stopped answering set-points or requests."""


class FollowingError(DriveError):
    """A drive is not where it was told to be, or its position jumped."""


class CameraError(FieldError):
    """A camera is not there, or does not give the pictures it should."""


class CameraMismatchError(CameraError):
    """What is there cannot be used as configured; to wait for it is no use."""
